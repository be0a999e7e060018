"""The emulated robot: two drives, the leg that they turn, and their faults.

Time comes as an argument. Nothing here knows of sockets, terminals or the clock on the wall.
"""

import hashlib
import math
import struct
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from moteus.protocol import Register

from hopping_leg.arrays import Array
from hopping_leg.deploy.drive_link import DriveMode
from hopping_leg.deploy.frames import Frame
from hopping_leg.deploy.preflight import required_settings
from hopping_leg.emulator import bus, leg, settings
from hopping_leg.emulator.drive import EmulatedDrive
from hopping_leg.emulator.faults import KINDS, Delivery, Fault, FaultKind
from hopping_leg.emulator.reply_queue import QueuedReply, TimedQueue
from hopping_leg.robot import JOINTS, REGISTER_MAP, Robot
from hopping_leg.robot.hardware import SENSOR_REGISTERS

_MODEL = 0x0000  # Board r4
_FIRMWARE = 0x010D  # Firmware version in its binary-coded form
_ALL_VALID = {Register.ENCODER_VALIDITY: 0b111111}
_AIRBORNE = 0.01  # Height of the foot in a flight that counts as the first, m: no bounce


class EmulatedRobot:
    """Leg and drives from joint angles, rad, (2,), moved by ``advance`` and ``receive``."""

    def __init__(
        self,
        robot: Robot,
        q: Array,
        *,
        configured: bool = True,
        homed: bool = True,
        held: bool = True,
        seed: int = 0,
        faults: Sequence[Fault] = (),
    ) -> None:
        self.robot, self.time, self.held = robot, 0.0, held
        self.patience, self._heard = math.inf, 0.0
        """Silence, s, after which somebody brings back and holds a leg whose drives are off."""
        self.leg = leg.EmulatedLeg(robot, q, seed)
        self.drives = tuple(_drive(robot, joint, configured) for joint in range(len(JOINTS)))
        self._latency, self._rng = robot.reality.latency, np.random.default_rng(seed)
        self._late_messages = TimedQueue[bus.Message]()
        self._last_delivery = 0.0
        for joint, drive in enumerate(self.drives):
            position, *_ = self.leg.sensed(joint)
            drive.boot(position)
            if homed:
                drive.encoder.set_nearest(position)
        self.reply_queue = TimedQueue[QueuedReply]()  # What is on its way to the host
        self.wire_time = 0.0  # What a reply takes at least, s
        self.plugged = True  # Whether the adapter is plugged in
        self.on_message: Callable[[float, int, bus.Message, Frame | None], None] = lambda *_: None
        """Told the time, s, a drive (0 hip, 1 knee), what the host sends to it, and its answer."""
        self.on_mode: Callable[[float, int, DriveMode], None] = lambda *_: None
        """Told the time, s, and a drive's mode, after every step."""
        self._sense()
        self.fault_injector = FaultInjector(self, faults, self._rng)

    def rewire(self, joint: int, ratio: float) -> None:
        """Let a drive believe that its joint turns so many times as far as it does."""
        self.leg.wiring[joint] = ratio
        position, *_ = self.leg.sensed(joint)
        self.drives[joint].boot(position)
        self.drives[joint].encoder.set_nearest(position)

    def advance(self, until: float) -> None:
        """Simulate whole steps up to a time, s."""
        while self.time + leg.TIMESTEP <= until + 1e-9:
            self._step()

    def receive(self, frame: Frame) -> None:
        """Take a frame now and queue the answers; a latency of commands lets it act later."""
        message, self._heard = bus.Message.read(frame), self.time
        late = self._latency.command + self._latency.jitter * float(self._rng.random())
        if late:
            self._last_delivery = max(self.time + late, self._last_delivery)
            self._late_messages.put(self._last_delivery, message)
        for joint, drive in enumerate(self.drives):
            if not message.is_for(drive):
                continue
            if not late:
                bus.act(message, drive, self.time)
            answer = bus.answer(message, drive)
            self.on_message(self.time, joint, message, answer)
            if answer is not None:
                self.fault_injector.send(answer, joint)

    def _step(self) -> None:
        self.fault_injector.step()
        for message in self._late_messages.take(self.time):
            for drive in filter(message.is_for, self.drives):
                bus.act(message, drive, self.time)
        hip, knee = (drive.step(self.time, leg.TIMESTEP) for drive in self.drives)
        active = [drive.active for drive in self.drives]
        quiet = self.time - self._heard > self.patience
        self.held = not all(active) if self.held else quiet and not any(active)
        if self.held:
            self.leg.hold()
        else:
            self.leg.step((hip, knee))
        self.time += leg.TIMESTEP
        self._sense()

    def _sense(self) -> None:
        sensor = self.robot.hardware.height
        if sensor.source in SENSOR_REGISTERS:
            reading = {Register[sensor.source.upper()]: sensor.reading(self.leg.height)}
            self.drives[JOINTS.index(sensor.drive)].sensed = reading | _ALL_VALID
        for joint, drive in enumerate(self.drives):
            drive.update_sensors(*self.leg.sensed(joint))
            self.on_mode(self.time, joint, drive.machine.mode)


def _drive(robot: Robot, joint: int, configured: bool) -> EmulatedDrive:
    servo = robot.hardware.servos[joint]
    motor = (robot.hip, robot.knee)[joint].motor
    changes: dict[str, float] = {"id.id": servo.id}
    if configured:
        changes |= {setting.name: setting.value for setting in required_settings(robot, joint)}
    named = hashlib.sha256(f"{robot.name} {JOINTS[joint]}".encode()).digest()
    words = struct.unpack("<3I", named[:12])  # of the serial number
    identity = {
        Register.MODEL_NUMBER: _MODEL,
        Register.FIRMWARE_VERSION: _FIRMWARE,
        Register.REGISTER_MAP_VERSION: REGISTER_MAP,
        **{Register.SERIAL_NUMBER + k: word & 0x7FFFFFFF for k, word in enumerate(words)},
    }
    return EmulatedDrive(
        identity,
        settings.Settings(**changes),
        gear_ratio=motor.gear_ratio,
        brake=motor.peak_torque / motor.no_load_speed,
        voltage=robot.hardware.bus_voltage * robot.reality.voltage,
    )


class FaultInjector:
    """When the faults of one robot begin and end, and what becomes of replies meanwhile.

    ``log`` tells which fault began when, ``powered`` when both drives were powered for the first
    time, and ``flown`` when the foot then left the ground first, s.
    """

    def __init__(
        self, robot: "EmulatedRobot", faults: Sequence[Fault], rng: np.random.Generator
    ) -> None:
        self._robot, self._rng = robot, rng
        self._pending = [fault for fault in faults if not KINDS[fault.kind].at_start]
        self._running: list[FaultKind] = []
        self.log: list[tuple[float, Fault]] = []
        self.powered = self.flown = math.inf
        for fault in faults:
            if KINDS[fault.kind].at_start:
                self._begin(fault)

    def add(self, fault: Fault) -> None:
        """Add a fault whose time counts from now, whatever its ``since`` says."""
        self._pending.append(replace(fault, since="start", at=fault.at + self._robot.time))

    def step(self) -> None:
        """Begin, update and end what is due before a step of physics."""
        self._watch()
        time = self._robot.time
        since = {"start": 0.0, "powered": self.powered, "flight": self.flown}
        for fault in list(self._pending):
            if time >= since[fault.since] + fault.at:
                self._pending.remove(fault)
                self._running.append(self._begin(fault))
        for running in list(self._running):
            if running.over:
                self._running.remove(running)
                running.end()
            else:
                running.update()

    def send(self, frame: Frame, joint: int) -> None:
        """Queue a drive's reply (0 hip, 1 knee), or what becomes of it."""
        delivery = Delivery(self._robot.time + self._robot.wire_time)
        for running in self._running:
            if joint in running.fault.joints:
                running.replies_left -= 1
                running.on_reply(delivery)
        for _ in range(delivery.copies):
            self._robot.reply_queue.put(delivery.due, QueuedReply(frame, flip=delivery.flip))

    def _watch(self) -> None:
        """Record when both drives are powered, and then the first lift-off."""
        robot = self._robot
        if math.isinf(self.powered) and all(drive.active for drive in robot.drives):
            self.powered = robot.time
        unflown = math.isinf(self.flown) and math.isfinite(self.powered)
        if unflown and robot.leg.foot_clearance > _AIRBORNE:
            self.flown = robot.time

    def _begin(self, fault: Fault) -> FaultKind:
        running = KINDS[fault.kind](fault, self._robot, self._rng)
        self.log.append((self._robot.time, fault))
        running.begin()
        return running
