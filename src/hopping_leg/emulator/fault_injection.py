"""When faults begin and end, and what becomes of replies meanwhile."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hopping_leg.emulator.faults import KINDS, Delivery, Fault, FaultKind, FaultyRobot
from hopping_leg.emulator.frames import Frame, QueuedReply

_AIRBORNE = 0.01
"""Height of the foot in a flight that counts as the first, m: no bounce."""


class FaultInjector:
    """The faults of one emulated robot.

    Args:
        robot: That has them.
        faults: The script.
        rng: Chooses the bits that flip.

    Attributes:
        log: Which fault began when, s.
        flown: When the foot left the ground for the first time, s.
    """

    def __init__(
        self, robot: FaultyRobot, faults: Sequence[Fault], rng: np.random.Generator
    ) -> None:
        self._robot, self._rng = robot, rng
        self._pending = [fault for fault in faults if not KINDS[fault.kind].at_start]
        self._running: list[FaultKind] = []
        self.log: list[tuple[float, Fault]] = []
        self._powered = self.flown = math.inf
        self._contact, self._rate = True, 0.0
        for fault in faults:
            if KINDS[fault.kind].at_start:
                self._begin(fault)

    def add(self, fault: Fault) -> None:
        """Add a fault whose time counts from now, whatever its ``since`` says."""
        self._pending.append(replace(fault, since="start", at=fault.at + self._robot.time))

    def step(self) -> None:
        """Begin, update and end what is due before a step of physics."""
        phases, time = self._phases(), self._robot.time
        since = {"start": 0.0, "powered": self._powered, "flight": self.flown}
        for fault in list(self._pending):
            if time >= since[fault.since] + fault.at and fault.phase in phases:
                self._pending.remove(fault)
                self._running.append(self._begin(fault))
        for running in list(self._running):
            if running.over:
                self._running.remove(running)
                running.end()
            else:
                running.update()

    def send(self, frame: Frame, joint: int, wire_time: float) -> None:
        """Queue a drive's reply, or what becomes of it.

        Args:
            frame: The reply.
            joint: 0 for the hip, 1 for the knee.
            wire_time: What it takes at least, s.
        """
        delivery = Delivery(self._robot.time + wire_time)
        for running in self._running:
            if joint in running.fault.joints:
                running.replies_left -= 1
                running.on_reply(delivery)
        for _ in range(delivery.copies):
            self._robot.reply_queue.put(delivery.due, QueuedReply(frame, flip=delivery.flip))

    def _phases(self) -> set[str]:
        """Return the phases of this moment; record power and the first lift-off."""
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

    def _begin(self, fault: Fault) -> FaultKind:
        running = KINDS[fault.kind](fault, self._robot, self._rng)
        self.log.append((self._robot.time, fault))
        running.begin()
        return running
