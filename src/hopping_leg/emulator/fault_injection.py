"""Faults at work: they begin when their time has come and are felt by drives and replies."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from hopping_leg.emulator.faults import Fault
from hopping_leg.emulator.frames import Frame
from hopping_leg.emulator.reply_queue import QueuedReply, ReplyQueue

if TYPE_CHECKING:
    from hopping_leg.emulator.robot import EmulatedRobot

_AIRBORNE = 0.01
"""Height of the foot in a flight that counts as the first, m: no bounce."""

_FLIPS = 1 << 16
_NOISE = b"@#!%\x07~ moteus?"
_REPLIES = ("drop_reply", "corrupt_reply", "late_reply", "duplicate_reply", "silence")
_AT_START = ("boot_pose", "configuration")


@dataclass
class _Running:
    """A fault that has begun.

    Attributes:
        fault: Which.
        begun: When, s.
        left: Replies that it still meets; infinite where a duration is given.
    """

    fault: Fault
    begun: float
    left: float = field(default=math.inf)

    def over(self, time: float) -> bool:
        lasts = self.fault.lasts
        return self.left <= 0 or (not math.isnan(lasts) and time >= self.begun + lasts)


class FaultInjector:
    """The faults of one emulated robot.

    Args:
        robot: That they befall.
        faults: The script.
        rng: Of the bits that flip.
    """

    def __init__(
        self, robot: "EmulatedRobot", faults: Sequence[Fault], rng: np.random.Generator
    ) -> None:
        self._robot, self._rng = robot, rng
        self._waiting = [fault for fault in faults if fault.kind not in _AT_START]
        self._running: list[_Running] = []
        self.log: list[tuple[float, Fault]] = []
        """Which fault began when, s."""
        self._powered = math.inf
        self.flown = math.inf
        """When the foot left the ground for the first time, s."""
        self._contact, self._rate = True, 0.0
        self.plugged = True
        """Whether the adapter is plugged in."""
        for fault in faults:
            if fault.kind in _AT_START:
                self._spoil_start(fault)

    def add(self, fault: Fault) -> None:
        """Wait for a fault whose time counts from now, whatever its ``since`` says."""
        self._waiting.append(replace(fault, since="start", at=fault.at + self._robot.time))

    def step(self) -> None:
        """Look at the robot before a step of physics: begin and end what is due."""
        robot = self._robot
        if not self._waiting and not self._running:
            self._watch()
            return
        phases = self._watch()
        since = {"start": 0.0, "powered": self._powered, "flight": self.flown}
        for fault in list(self._waiting):
            if robot.time >= since[fault.since] + fault.at and fault.phase in phases:
                self._waiting.remove(fault)
                self._begin(fault)
        for running in list(self._running):
            if running.over(robot.time):
                self._running.remove(running)
                self._feel(running, ending=True)
            elif running.fault.kind == "over_temperature":
                self._feel(running)

    def send(self, frame: Frame, joint: int, reply_queue: ReplyQueue) -> None:
        """Put a drive's reply in the reply_queue, or what becomes of it."""
        time = self._robot.time
        due, copies, flip = time + self._robot.wire_time, 1, -1
        for running in self._running:
            fault = running.fault
            if fault.kind not in _REPLIES or joint not in fault.joints:
                continue
            running.left -= 1
            if fault.kind == "late_reply":
                due += fault.amount
            copies += fault.kind == "duplicate_reply"
            if fault.kind == "corrupt_reply":
                flip = int(self._rng.integers(_FLIPS))
            if fault.kind in ("drop_reply", "silence"):
                copies = 0
        for _ in range(copies):
            reply_queue.put(due, QueuedReply(frame, flip=flip))

    def _watch(self) -> set[str]:
        """Return the phases of this moment; the first lift-off and power are noted."""
        robot = self._robot
        if math.isinf(self._powered) and all(drive.active for drive in robot.drives):
            self._powered = robot.time
        contact, rate = robot.leg.foot_clearance <= 0, robot.leg.height_rate
        phases = {"any", "stance" if contact else "flight"}
        if not contact:
            phases.add("rising" if rate > 0 else "falling")
            if self._rate > 0 >= rate:
                phases.add("apex")
            airborne = robot.leg.foot_clearance > _AIRBORNE
            if airborne and math.isinf(self.flown) and math.isfinite(self._powered):
                self.flown = robot.time
        elif not self._contact:
            phases.add("touchdown")
        self._contact, self._rate = contact, rate
        return phases

    def _begin(self, fault: Fault) -> None:
        running = _Running(fault, self._robot.time)
        if math.isnan(fault.lasts):
            running.left = fault.count * len(fault.joints)
        self._running.append(running)
        self.log.append((self._robot.time, fault))
        self._feel(running)
        if fault.kind == "garbage_line":
            running.left = 0
            for _ in range(fault.count):
                self._robot.reply_queue.put(self._robot.time, QueuedReply(noise=_NOISE))

    def _feel(self, running: _Running, *, ending: bool = False) -> None:
        """Let the drives feel a fault, or no longer."""
        fault, robot = running.fault, self._robot
        if fault.kind == "unplug":
            self.plugged = ending
        for joint in fault.joints:
            drive = robot.drives[joint]
            felt = drive.disturbances
            if fault.kind == "encoder_jump":
                jump = robot.leg.transforms[joint].motor_velocity(fault.amount)
                drive.encoder.jump = 0.0 if ending else jump * drive.encoder.gear_ratio
            elif fault.kind == "drive_fault":
                felt.fault = 0 if ending else int(fault.amount)
            elif fault.kind == "limit_notice":
                felt.notice = 0 if ending else int(fault.amount)
            elif fault.kind in ("over_voltage", "under_voltage"):
                felt.voltage = 0.0 if ending else fault.amount - drive.nominal_voltage
            elif fault.kind == "over_temperature":
                passed = robot.time - running.begun
                felt.temperature = 0.0 if ending else fault.amount * passed
            elif fault.kind == "power_loss" and not ending:
                drive.boot(robot.leg.sensed(joint)[0])

    def _spoil_start(self, fault: Fault) -> None:
        for joint in fault.joints:
            drive = self._robot.drives[joint]
            if fault.kind == "boot_pose":
                drive.encoder.misplace(fault.amount)
            else:
                drive.settings.set(fault.name, repr(fault.amount))
                drive.settings.save()
        self.log.append((self._robot.time, fault))
