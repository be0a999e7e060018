"""Both drives behind an adapter, in pure torque mode.

Questions and answers go to and fro in the caller's own thread, and never take longer than they may.
What the frames say is the client library's, ``moteus``.
"""

import math
import struct
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from moteus import Controller, QueryResolution, multiplex
from moteus.command import Command
from moteus.protocol import Register

from hopping_leg.deploy import drive_link, frames, realtime, replies
from hopping_leg.deploy.fdcanusb import SerialSensor
from hopping_leg.deploy.transport import Transport
from hopping_leg.robot import kinematics
from hopping_leg.robot.hardware import SENSOR_REGISTERS, HeightSensor
from hopping_leg.robot.parameters import JOINTS, Robot

_NO_POSITION_CONTROL = {"position": math.nan, "velocity": 0.0} | dict.fromkeys(
    ("kp_scale", "kd_scale", "ilimit_scale"), 0.0
)
_PLACE = 1234.5  # Stands where a torque goes, N m
_PLACE_BYTES = struct.pack("<f", _PLACE)


class MoteusLink:
    """The way to a robot's two drives; closes the transport that carries the frames.

    Without a clock the time is the computer's. ``controllers``, of the client library, make
    commands.
    """

    def __init__(
        self, robot: Robot, transport: Transport, clock: realtime.Clock | None = None
    ) -> None:
        self.clock = clock or realtime.RealClock()
        self.robot, self.transforms = robot, drive_link.joint_transforms(robot)
        self.transport = transport
        self._clocks = (replies.DriveClock(), replies.DriveClock())
        sensor = robot.hardware.height
        self._line = SerialSensor(sensor.source, sensor.baud) if "/" in sensor.source else None
        self.controllers = [
            Controller(wire.id, query_resolution=_resolution(sensor, joint))
            for joint, wire in zip(JOINTS, self.transforms, strict=True)
        ]
        self._made = {
            (action, query): self._make(action, query=query)
            for action in drive_link.Action
            for query in (False, True)
        }

    @property
    def trouble(self) -> str:
        """What went wrong with the adapter last, for the record."""
        return self.transport.trouble

    def exchange(self, outgoing: drive_link.DriveCommand, until: float) -> drive_link.Exchange:
        """Tell both drives what to do and ask for their state, by ``until``, s on our clock."""
        asked, late = self.clock.now(), list[tuple[int, drive_link.Reply]]()
        fresh: list[drive_link.Reply | None] = [None, None]
        self.transport.send(self._frames(outgoing, query=True))
        for frame in self._arriving(until):
            for joint, wire in enumerate(self.transforms):
                if frame.arbitration_id == wire.id << 8 and fresh[joint] is None:
                    clock, now = self._clocks[joint], self.clock.now()
                    reply = replies.read_reply(frame.data, wire, clock, now)
                    if reply is not None and reply.taken < asked - replies.SLACK:
                        late.append((joint, reply))
                    else:
                        fresh[joint] = reply
            if all(fresh):
                break
        hip, knee = fresh
        found = drive_link.Exchange((hip, knee), tuple(late))
        if not self.robot.hardware.height.source:
            return found
        sensed = [reply.sensed for reply in fresh if reply]
        reading = self.sensed(next(filter(math.isfinite, sensed), math.nan))
        height = self.robot.hardware.height.height(reading)
        q = np.array([reply.position if reply else math.nan for reply in fresh])
        clearance = kinematics.foot_clearance(self.robot, np.array(height), q)
        return replace(found, height=height, clearance=float(clearance))

    def sensed(self, by_drive: float) -> float:
        """Return what the height sensor reads, at a drive or on its own line, NaN if nothing."""
        return self._line.newest() if self._line else by_drive

    def send(self, outgoing: drive_link.DriveCommand) -> None:
        """Tell both drives what to do; returns at once."""
        self.transport.send(self._frames(outgoing, query=False))

    def tell(self, command: Command) -> None:
        """Send one of the client library's commands."""
        self.transport.send([_frame(command)])

    def ask(self, command: Command, seconds: float) -> frames.Frame | None:
        """Send one of the client library's commands; return its answer, None if none came."""
        asked = _frame(command)
        self.transport.send([asked])
        for frame in self._arriving(self.clock.now() + seconds):
            if frame.answers(asked) and command.reply_filter(frame):
                return frame
        return None

    def close(self) -> None:
        """Give the adapter back; another link may open it then."""
        self.transport.close()
        if self._line:
            self._line.close()

    def _arriving(self, until: float) -> Iterator[frames.Frame]:
        """Yield frames as they arrive; ends at a time, s, however many there are."""
        while (arrived := self.transport.receive(until)) is not None:
            yield from arrived
            if self.clock.now() >= until:
                return

    def _frames(self, outgoing: drive_link.DriveCommand, *, query: bool) -> list[frames.Frame]:
        """Return the frames of a command; those of a torque differ in its four bytes alone."""
        made = self._made[outgoing.action, query]
        if outgoing.action is not drive_link.Action.TORQUE:
            return made
        pairs = zip(made, self.transforms, outgoing.torque, strict=True)
        return [_with_torque(frame, wire.motor_torque(torque)) for frame, wire, torque in pairs]

    def _make(self, action: drive_link.Action, *, query: bool) -> list[frames.Frame]:
        """Let the client library make the frames of an action."""
        torque = _NO_POSITION_CONTROL | {"feedforward_torque": _PLACE}
        torque["watchdog_timeout"] = self.robot.hardware.watchdog
        frames_made = []
        for drive, joint in zip(self.controllers, (self.robot.hip, self.robot.knee), strict=True):
            match action:
                case drive_link.Action.TORQUE:
                    most = joint.motor.torque_limit
                    command = drive.make_position(**torque, maximum_torque=most, query=query)
                case drive_link.Action.BRAKE:
                    command = drive.make_brake(query=query)
                case drive_link.Action.STOP:
                    command = drive.make_stop(query=query)
            frames_made.append(_frame(command))
        return frames_made


def _with_torque(frame: frames.Frame, torque: float) -> frames.Frame:
    before, _, after = frame.data.partition(_PLACE_BYTES)
    return frames.Frame(frame.arbitration_id, before + struct.pack("<f", torque) + after)


def _frame(command: Command) -> frames.Frame:
    wanted = frames.REPLY_WANTED * command.reply_required
    number = command.destination | wanted | command.source << 8
    return frames.Frame(number, command.data)


def _resolution(sensor: HeightSensor, joint: str) -> QueryResolution:
    resolution = QueryResolution()
    resolution.voltage = resolution.temperature = multiplex.INT16
    resolution._extra = {int(Register.MILLISECOND_COUNTER): multiplex.INT32}
    if joint == sensor.drive and sensor.source in SENSOR_REGISTERS:
        resolution._extra[int(Register[sensor.source.upper()])] = multiplex.F32
        resolution._extra[int(Register.ENCODER_VALIDITY)] = multiplex.INT8
    return resolution
