"""What can go wrong: an entry of a fault script says what and when, a class per kind what it does.

A new kind is a subclass of ``FaultKind`` here, and a family in the study of faults.
"""

import math
from collections import deque
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal, Protocol

import numpy as np
from msgspec import Meta

from hopping_leg.emulator import reply_queue, settings
from hopping_leg.errors import UsageError, unknown_name
from hopping_leg.io import parse_toml, read_dataclass
from hopping_leg.robot.parameters import JOINTS

if TYPE_CHECKING:
    from hopping_leg.emulator.drive import EmulatedDrive
    from hopping_leg.emulator.leg import EmulatedLeg

KINDS: "dict[str, type[FaultKind]]" = {}  # Every kind that a script may name

Registers = dict[int, float]  # What a drive says, by register
_FLIPS = 1 << 16
_NOISE = b"@#!%\x07~ moteus?"


@dataclass(frozen=True)
class Fault:
    """One entry of a fault script; UsageError says which field has no meaning."""

    kind: str
    since: Literal["start", "powered", "flight"] = "powered"
    """From when on ``at`` counts: the emulator's start, both drives powered, first lift-off."""
    at: Annotated[float, Meta(ge=0)] = 0.0
    """Seconds after ``since``."""
    drive: Literal["hip", "knee", "both"] = "both"
    value: float | None = None
    """In the unit of the kind; none takes the kind's default."""
    duration: Annotated[float, Meta(ge=0)] | None = None
    """Seconds; none takes the kind's default, which for replies is their number."""
    count: Annotated[int, Meta(ge=1)] = 1
    """Replies, where the kind is about replies and no duration is given."""
    name: str = ""
    """Setting that is wrong, for ``configuration``."""

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise UsageError(unknown_name("fault kind", self.kind, KINDS))
        KINDS[self.kind].check(self)

    @property
    def amount(self) -> float:
        """The value or its default."""
        return KINDS[self.kind].value if self.value is None else float(self.value)

    @property
    def lasts(self) -> float:
        """The duration or its default, s; NaN where ``count`` replies are meant."""
        return KINDS[self.kind].duration if self.duration is None else float(self.duration)

    @property
    def joints(self) -> tuple[int, ...]:
        """Drives that have it: 0 for the hip, 1 for the knee."""
        return (0, 1) if self.drive == "both" else (JOINTS.index(self.drive),)


class FaultyRobot(Protocol):
    """What faults change."""

    time: float  # s
    plugged: bool
    """Whether the adapter is plugged in."""
    leg: "EmulatedLeg"
    reply_queue: reply_queue.TimedQueue[reply_queue.QueuedReply]

    @property
    def drives(self) -> "tuple[EmulatedDrive, ...]":
        """Hip and knee."""

    def rewire(self, joint: int, ratio: float) -> None:
        """Let a drive believe that its joint turns so many times as far as it does."""


@dataclass
class Delivery:
    """How a drive's reply reaches the host."""

    due: float  # s
    copies: int = 1
    flip: int = -1
    """Which bits flip, see ``QueuedReply``."""


class FaultKind:
    """A fault at work; a subclass says what it does, by default how much and how long.

    The duration is in s, NaN where a number of replies is meant. One ``at_start`` is there from the
    beginning, whatever the script says of its time; the value of one that ``rises`` is a rate.
    """

    text: ClassVar[str]
    unit: ClassVar[str] = ""
    value: ClassVar[float] = 0.0
    duration: ClassVar[float] = math.inf
    at_start: ClassVar[bool] = False
    rises: ClassVar[bool] = False

    def __init_subclass__(cls, *, kind: str = "") -> None:
        if kind:
            KINDS[kind] = cls

    def __init__(self, fault: Fault, robot: FaultyRobot, rng: np.random.Generator) -> None:
        self.fault, self.robot, self.rng = fault, robot, rng
        self.begun = robot.time
        self.replies_left = math.inf
        if math.isnan(fault.lasts):
            self.replies_left = fault.count * len(fault.joints)

    @classmethod
    def check(cls, fault: Fault) -> None:
        """Refuse an entry that the kind cannot do; raises ``UsageError``."""

    @property
    def drives(self) -> "list[EmulatedDrive]":
        """Those that have the fault."""
        return [self.robot.drives[joint] for joint in self.fault.joints]

    def other(self, drive: "EmulatedDrive") -> "EmulatedDrive":
        """Return the robot's other drive."""
        return next(one for one in self.robot.drives if one is not drive)

    @property
    def over(self) -> bool:
        """Whether it has lasted as long as it should."""
        return self.replies_left <= 0 or self.robot.time >= self.begun + self.fault.lasts

    @property
    def level(self) -> float:
        """What is wrong now, in the kind's unit."""
        return self.fault.amount * (self.robot.time - self.begun if self.rises else 1.0)

    def begin(self) -> None:
        """Set the robot's fault when its time has come."""

    def update(self) -> None:
        """Change it before each step of physics."""
        if self.rises:
            self.begin()

    def end(self) -> None:
        """Reset the robot when the fault is over."""

    def on_reply(self, delivery: Delivery) -> None:
        """Change how a reply of one of the drives is delivered."""


class _DropReply(FaultKind, kind="drop_reply"):
    text = "replies are lost"
    duration = math.nan

    def on_reply(self, delivery: Delivery) -> None:
        delivery.copies = 0


class _CorruptReply(FaultKind, kind="corrupt_reply"):
    text = "bits of replies flip on the serial line"
    duration = math.nan

    def on_reply(self, delivery: Delivery) -> None:
        delivery.flip = int(self.rng.integers(_FLIPS))


class _LateReply(FaultKind, kind="late_reply"):
    text, unit, value = "replies arrive later", "s", 0.012
    duration = math.nan

    def on_reply(self, delivery: Delivery) -> None:
        delivery.due += self.fault.amount


class _DuplicateReply(FaultKind, kind="duplicate_reply"):
    text = "replies arrive twice"
    duration = math.nan

    def on_reply(self, delivery: Delivery) -> None:
        delivery.copies += 1


class _Silence(_DropReply, kind="silence"):
    text = "no reply arrives any more"
    duration = math.inf


class _GarbageLine(FaultKind, kind="garbage_line"):
    text = "noise arrives as a line of its own"
    duration = math.nan

    def begin(self) -> None:
        self.replies_left = 0
        for _ in range(self.fault.count):
            self.robot.reply_queue.put(self.robot.time, reply_queue.QueuedReply(noise=_NOISE))


class _EncoderJump(FaultKind, kind="encoder_jump"):
    text, unit, value = "a joint's angle is wrong from now on", "rad", 0.5

    def begin(self) -> None:
        self.shift(self.level)

    def end(self) -> None:
        self.shift(0.0)

    def shift(self, angle: float) -> None:
        for joint, drive in zip(self.fault.joints, self.drives, strict=True):
            jump = self.robot.leg.transforms[joint].motor_velocity(angle)
            drive.encoder.jump = jump * drive.encoder.gear_ratio


class _EncoderDrift(_EncoderJump, kind="encoder_drift"):
    text, unit, value = "a joint's angle drifts, its velocity does not", "rad/s", 0.3
    rises = True


class _Disturbance(FaultKind):
    field: ClassVar[str]
    """Of ``Disturbances``."""
    usual: ClassVar[float] = 0.0

    def begin(self) -> None:
        self.disturb(self.level)

    def end(self) -> None:
        self.disturb(self.usual)

    def disturb(self, level: float) -> None:
        for drive in self.drives:
            kind = type(getattr(drive.disturbances, self.field))
            setattr(drive.disturbances, self.field, kind(level))


class _DriveFault(_Disturbance, kind="drive_fault"):
    text, unit, value = "a drive goes to fault with this code", "code", 33.0
    field = "fault"


class _OverTemperature(_Disturbance, kind="over_temperature"):
    text, unit, value = "a drive warms up", "K/s", 40.0
    field, rises = "temperature", True


class _OverVoltage(_Disturbance, kind="over_voltage"):
    text, unit, value = "the bus voltage rises to", "V", 50.0
    field = "voltage"

    def begin(self) -> None:
        self.disturb(self.level - self.drives[0].nominal_voltage)


class _UnderVoltage(_OverVoltage, kind="under_voltage"):
    text, value = "the bus voltage sags to", 10.0


_SAMPLE = _POSITION, _VELOCITY, _TORQUE = 0x001, 0x002, 0x003
_MULTIPLEX_ID = 0x110  # Registers, as numbers: kinds are listed without the client library


class _Lie(FaultKind):
    """A drive whose replies are in time and whole, and not true."""

    def begin(self) -> None:
        for drive in self.drives:
            drive.disturbances.report = partial(self.said, drive)

    def end(self) -> None:
        for drive in self.drives:
            drive.disturbances.report = lambda true: true

    def said(self, drive: "EmulatedDrive", true: Registers) -> Registers:
        """Return what a drive says of its true registers."""
        raise NotImplementedError


class _SampleFrozen(_Lie, kind="sample_frozen"):
    text = "position, velocity and torque repeat"

    def begin(self) -> None:
        self.frozen = [self.sample(drive.state()) for drive in self.drives]
        super().begin()

    def sample(self, registers: Registers) -> Registers:
        return {register: registers[register] for register in _SAMPLE}

    def said(self, drive: "EmulatedDrive", true: Registers) -> Registers:
        return true | self.frozen[self.drives.index(drive)]


class _EncoderDead(_SampleFrozen, kind="encoder_dead"):
    text = "a position repeats, its velocity is zero"

    def sample(self, registers: Registers) -> Registers:
        return {_POSITION: registers[_POSITION], _VELOCITY: 0.0}


class _VelocityFalse(_Lie, kind="velocity_false"):
    text, unit, value = "a velocity is this many times the true one", "1", 0.5
    register: ClassVar[int] = _VELOCITY

    def said(self, drive: "EmulatedDrive", true: Registers) -> Registers:
        return true | {self.register: self.fault.amount * true[self.register]}


class _TorqueFalse(_VelocityFalse, kind="torque_false"):
    text, value = "a torque is reported as this many times the true one", 0.0
    register = _TORQUE


class _StaleSample(_Lie, kind="stale_sample"):
    text, unit, value = "samples are older than their date says", "s", 0.01

    def begin(self) -> None:
        self.past = [deque[tuple[float, Registers]]() for _ in self.drives]
        super().begin()

    def update(self) -> None:
        oldest = self.robot.time - self.fault.amount
        for past, drive in zip(self.past, self.drives, strict=True):
            past.append((self.robot.time, drive.true_state()))
            while len(past) > 1 and past[1][0] <= oldest:
                past.popleft()

    def said(self, drive: "EmulatedDrive", true: Registers) -> Registers:
        past = self.past[self.drives.index(drive)]
        return true | {r: past[0][1][r] for r in _SAMPLE if past}


class _SwappedReplies(_Lie, kind="swapped_replies"):
    text = "each drive says what the other one is like"

    def said(self, drive: "EmulatedDrive", true: Registers) -> Registers:
        return self.other(drive).true_state() | {_MULTIPLEX_ID: drive.id}


class _SameId(FaultKind, kind="same_id"):
    text = "a drive takes the other one's CAN id"

    def begin(self) -> None:
        drive = self.drives[0]
        drive.settings.set("id.id", str(self.other(drive).id))


class _FastClock(_Disturbance, kind="fast_clock"):
    text, unit, value = "a drive's clock counts so many seconds in one", "1", 1.01
    field, usual = "clock", 1.0


class _LimitNotice(_Disturbance, kind="limit_notice"):
    text, unit, value = "a drive reports that a limit is at work", "code", 102.0
    field = "notice"


class _Unplug(FaultKind, kind="unplug"):
    text = "the adapter is pulled out, and back in after the duration"
    duration = 0.5

    def begin(self) -> None:
        self.robot.plugged = False

    def end(self) -> None:
        self.robot.plugged = True


class _PowerLoss(FaultKind, kind="power_loss"):
    text = "a drive restarts: stopped, and not homed"

    def begin(self) -> None:
        for joint, drive in zip(self.fault.joints, self.drives, strict=True):
            drive.boot(self.robot.leg.sensed(joint)[0])


class _BootPose(FaultKind, kind="boot_pose"):
    text, unit, value = "a drive counts rotor turns wrongly, from the start", "turns", 1.0
    at_start = True

    def begin(self) -> None:
        for drive in self.drives:
            drive.encoder.shift_rotor(self.fault.amount)


class _Ratio(FaultKind, kind="ratio"):
    text, unit, value = "a drive believes its joint to turn so many times as far", "1", 2.0
    at_start = True
    sign: ClassVar[float] = 1.0

    @classmethod
    def check(cls, fault: Fault) -> None:
        if not fault.amount > 0:
            raise UsageError(f"'value' of a {fault.kind} is {fault.amount:g} but must be above 0.")

    def begin(self) -> None:
        for joint in self.fault.joints:
            self.robot.rewire(joint, self.sign * self.fault.amount)


class _Reversed(_Ratio, kind="reversed"):
    text = "a motor turns its joint the other way than the robot's file says, from the start"
    unit, value, sign = "", 1.0, -1.0


class _Configuration(FaultKind, kind="configuration"):
    text, unit = "a drive's setting is wrong, from the start", "as the setting's"
    at_start = True

    @classmethod
    def check(cls, fault: Fault) -> None:
        if fault.name not in settings.DEFAULTS:
            raise UsageError(unknown_name("drive setting", fault.name, settings.DEFAULTS))

    def begin(self) -> None:
        for drive in self.drives:
            drive.settings.set(self.fault.name, repr(self.fault.amount))
            drive.settings.save()


def load_faults(path: Path) -> tuple[Fault, ...]:
    """Read a script, or raise UsageError where it is no TOML or has no meaning."""
    tree = parse_toml(path.read_bytes(), str(path))
    entries = tree.pop("fault", None)
    if tree or not isinstance(entries, list):
        raise UsageError(f"{path} must hold tables [[fault]] and nothing else.")
    return tuple(
        read_dataclass(Fault, entry, f"{path}, fault {n + 1}") for n, entry in enumerate(entries)
    )
