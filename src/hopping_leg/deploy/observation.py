"""What the supervisor sees at a tick and what it lets out; joint side, SI."""

from dataclasses import dataclass
from enum import Enum, IntEnum

Pair = tuple[float, float]
"""Of hip and knee."""


class DriveMode(IntEnum):
    """Modes of a drive that matter here (register 0x000)."""

    STOPPED = 0
    FAULT = 1
    ENABLING = 2
    CALIBRATING = 3
    CALIBRATED = 4
    TORQUE = 10
    TIMEOUT = 11
    BRAKE = 15


@dataclass(frozen=True, slots=True)
class Reply:
    """One drive's state.

    Attributes:
        position: Joint angle, rad.
        velocity: Joint velocity, rad/s.
        torque: At the joint, N m.
        mode: As in ``DriveMode``; others occur.
        fault: Code, 0 for none.
        voltage: Of the bus, V.
        temperature: Of the drive's electronics, deg C.
        taken: When it was measured, s on the host's clock.
    """

    position: float
    velocity: float
    torque: float
    mode: int
    fault: int
    voltage: float
    temperature: float
    taken: float


Replies = tuple[Reply | None, Reply | None]
"""Of hip and knee; None where no fresh reply came."""


class Operator(Enum):
    """What the operator asked for since the last tick."""

    NO_NOISE = 0
    ARM = 1
    STOP = 2


@dataclass(frozen=True, slots=True)
class Observation:
    """Everything that a decision of the supervisor depends on.

    Attributes:
        time: Of the tick, s.
        late: How long after its deadline the tick began, s.
        replies: Fresh in this tick.
        wanted: Joint torques that the sequence asks for, N m; None if the controller failed.
        operator: Since the last tick.
        finished: Whether the sequence is over.
    """

    time: float
    late: float
    replies: Replies
    wanted: Pair | None
    operator: Operator = Operator.NO_NOISE
    finished: bool = False


class Action(Enum):
    """What the drives are told."""

    STOP = 0
    """Windings open; also clears faults and timeouts."""
    TORQUE = 1
    BRAKE = 2
    """Windings shorted: damps without encoder or host."""


@dataclass(frozen=True, slots=True)
class Outgoing:
    """What leaves for the drives.

    Attributes:
        action: What they do.
        torque: At the joints, N m; zero unless the action is ``TORQUE``.
    """

    action: Action
    torque: Pair = (0.0, 0.0)


STOP = Outgoing(Action.STOP)
BRAKE = Outgoing(Action.BRAKE)
LIMP = Outgoing(Action.TORQUE)
"""Torque control at zero torque."""
