"""What goes between the loop and the drives, and the way there; joint side, SI."""

from dataclasses import dataclass
from enum import Enum, IntEnum
from typing import Protocol

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


class Action(Enum):
    """What the drives are told."""

    STOP = 0
    """Windings open; also clears faults and timeouts."""
    TORQUE = 1
    BRAKE = 2
    """Windings shorted: damps without encoder or host."""


@dataclass(frozen=True, slots=True)
class DriveCommand:
    """What leaves for the drives.

    Attributes:
        action: What they do.
        torque: At the joints, N m; zero unless the action is ``TORQUE``.
    """

    action: Action
    torque: Pair = (0.0, 0.0)


STOP = DriveCommand(Action.STOP)
BRAKE = DriveCommand(Action.BRAKE)
LIMP = DriveCommand(Action.TORQUE)
"""Torque control at zero torque."""


@dataclass(frozen=True, slots=True)
class Exchange:
    """What came back in a tick.

    Attributes:
        replies: Fresh ones: measured after this tick's question was asked.
        late: Drive (0 hip, 1 knee) and reply to an earlier tick that arrived now.
    """

    replies: Replies
    late: tuple[tuple[int, Reply], ...] = ()


class DriveLink(Protocol):
    """The way to both drives; nothing of it ever waits beyond what the caller allows."""

    def exchange(self, outgoing: DriveCommand, until: float) -> Exchange:
        """Tell both drives what to do and ask for their state in the same frames.

        Args:
            outgoing: What they shall do.
            until: When to stop waiting, s on the loop's clock.
        """
        ...

    def send(self, outgoing: DriveCommand) -> None:
        """Tell both drives what to do; returns at once."""
        ...

    def close(self) -> None:
        """Give the adapter back."""
        ...
