"""What a recording's rows do not say: rig, control loop, timing, limits, origin."""

import dataclasses
import math
import types
import typing
from dataclasses import dataclass, field
from typing import Any, Literal

from hopping_leg.errors import RecordingError, unknown_name
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
    metadata = _build(RecordingMetadata, tree, "", origin)
    assert isinstance(metadata, RecordingMetadata)
    return metadata


def _build(kind: type, tree: object, prefix: str, origin: str) -> object:
    if not isinstance(tree, dict):
        raise RecordingError(
            f"{origin}: '{prefix or 'the metadata'}' must be a table, not {tree!r}."
        )
    hints = typing.get_type_hints(kind)
    for key in tree:
        if key not in hints:
            raise RecordingError(f"{origin}: {unknown_name('metadata field', str(key), hints)}")
    required = [f.name for f in dataclasses.fields(kind) if _is_required(f)]
    for name in required:
        if name not in tree:
            raise RecordingError(
                f"{origin}: the metadata lacks '{name}'; it needs {', '.join(required)}."
            )
    values = {k: _value(hints[k], v, f"{prefix}{k}", origin) for k, v in tree.items()}
    try:
        return kind(**values)
    except RecordingError as error:
        raise RecordingError(f"{origin}: {error}") from None


def _is_required(spec: dataclasses.Field[Any]) -> bool:
    missing = dataclasses.MISSING
    return spec.default is missing and spec.default_factory is missing


def _value(kind: Any, value: object, path: str, origin: str) -> object:  # noqa: ANN401
    """Return a value as its field's type, or say what was valid."""
    choices = typing.get_args(kind)
    if isinstance(kind, types.UnionType) or typing.get_origin(kind) is typing.Union:
        return None if value is None else _value(choices[0], value, path, origin)
    if typing.get_origin(kind) is Literal:
        if value not in choices:
            raise RecordingError(
                f"{origin}: '{path}': {unknown_name('value', str(value), choices)}"
            )
        return value
    if typing.get_origin(kind) is tuple:
        if not isinstance(value, list | tuple) or len(value) != len(choices):
            raise RecordingError(
                f"{origin}: '{path}' is {value!r} but must be a pair [hip, knee] of numbers."
            )
        return tuple(_value(float, v, path, origin) for v in value)
    if dataclasses.is_dataclass(kind):
        return _build(typing.cast(type, kind), value, f"{path}.", origin)
    if kind is float:
        if (
            isinstance(value, bool)
            or not isinstance(value, int | float)
            or not math.isfinite(value)
        ):
            raise RecordingError(f"{origin}: '{path}' is {value!r} but must be a finite number.")
        return float(value)
    if not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
        names = {str: "a text in quotes", bool: "true or false", int: "a whole number"}
        raise RecordingError(f"{origin}: '{path}' is {value!r} but must be {names[kind]}.")
    return value
