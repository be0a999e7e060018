"""What a recording's rows do not say: rig, control loop, timing, limits, origin."""

import dataclasses
import math
from dataclasses import dataclass, field
from typing import Any, Literal

from hopping_leg.errors import RecordingError
from hopping_leg.io import read_dataclass
from hopping_leg.robot.model import GRAVITY

Rig = Literal["fixed-base", "rail", "boom"]
Sample = Literal["before-command", "after-command"]
Onboard = Literal["torque", "zoh", "continuous"]
Pair = tuple[float, float]


@dataclass(frozen=True)
class Quantisation:
    """Steps of the sensors; 0 where they are too fine to matter."""

    position: float = 0.0
    """rad"""
    velocity: float = 0.0
    """rad/s"""
    torque: float = 0.0
    """N m"""


@dataclass(frozen=True)
class RecordingMetadata:
    """How a recording was made; pairs are (hip, knee).

    Raises:
        RecordingError: A value is impossible.
    """

    rig: Rig
    """Where the base is: clamped, on the vertical rail, or on a boom."""
    rate_hz: float
    """Nominal rate of commands and rows."""
    robot: str
    """Robot file that the recording belongs to: a shipped name or a path."""
    source: str
    """Who recorded it, where and when."""
    effective_gravity: float = GRAVITY
    """Acceleration of the base in free flight, m/s2; below 9.81 on a boom with a counterweight."""
    sample: Sample = "before-command"
    """Whether row n holds the state before or after command n acted."""
    onboard: Onboard = "torque"
    """What the motors close by themselves: nothing (``torque``), a PD that holds each command
    for a period and computes its torque once per row (``zoh``), or one at many kHz
    (``continuous``)."""
    stiffness: Pair | None = None
    """Of the on-board PD, N m/rad at the joint; none where unknown."""
    damping: Pair | None = None
    """Of the on-board PD, N m s/rad at the joint; none where unknown."""
    integral: Pair | None = None
    """Of the on-board PID, N m/(rad s) at the joint; none where unknown or absent."""
    gains_exact: bool = True
    """False where the gains are estimates that a fit should refine."""
    zeroed: bool = False
    """Whether the encoders were zeroed with the leg hanging at rest, where friction may hold it
    some degrees off; a fit then finds each recording's zeros from its first second."""
    torque_limit: Pair | None = None
    """Largest torque the rig let through, N m at the joint; none takes the robot file's."""
    startup_rows: int = 0
    """First rows of the file whose commands were not applied; the loader leaves them out."""
    quantisation: Quantisation = field(default_factory=Quantisation)

    def __post_init__(self) -> None:
        for name in ("rate_hz", "effective_gravity"):
            if not 0 < getattr(self, name) < math.inf:
                value = getattr(self, name)
                raise RecordingError(f"'{name}' is {value} but must be positive and finite.")
        if self.startup_rows < 0:
            raise RecordingError(f"'startup_rows' is {self.startup_rows} but must be 0 or more.")
        for name in ("stiffness", "damping", "integral", "torque_limit"):
            pair = getattr(self, name)
            if pair is not None and not all(0 <= value < math.inf for value in pair):
                raise RecordingError(f"'{name}' is {pair} but must hold zero or more, finite.")

    @property
    def period(self) -> float:
        """Nominal time from row to row, s."""
        return 1 / self.rate_hz


def metadata_to_tree(metadata: RecordingMetadata) -> dict[str, Any]:
    """Return a metadata as nested tables for TOML or JSON; what is none is left out."""
    return {k: v for k, v in dataclasses.asdict(metadata).items() if v is not None}


def metadata_from_tree(tree: object, origin: str) -> RecordingMetadata:
    """Read a metadata from the tables of a sidecar or a header.

    Args:
        tree: Field names to values as in ``RecordingMetadata``; pairs are lists of two numbers.
        origin: The file, for messages.

    Raises:
        RecordingError: Naming file and field.
    """
    return read_dataclass(RecordingMetadata, tree, origin, error=RecordingError)
