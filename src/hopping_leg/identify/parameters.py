"""What is searched: named parameters with bounds, and the hypothesis that a vector stands for."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.errors import UsageError
from hopping_leg.identify.leg_hypothesis import LegHypothesis, parameter_units
from hopping_leg.robot.model import TIMESTEP

_RANGES = {
    "rail.friction": (0.0, 10.0),
    "rail.damping": (0.0, 20.0),
    "contact.time_constant": (2 * TIMESTEP, 0.2),
    "contact.damping_ratio": (0.1, 3.0),
    "contact.friction": (0.2, 2.0),
    "friction": (0.0, 1.0),
    "damping": (0.0, 1.0),
    "armature": (1e-6, 0.05),
    "drive.delay": (0.0, 0.02),
    "drive.velocity_window": (0.0, 0.02),
    "drive.ramp": (0.0, 1.0),
    "drive.stiffness": (0.0, 500.0),
    "drive.damping": (0.0, 10.0),
    "drive.integral": (0.0, 100.0),
    "drive.torque_limit": (0.5, 50.0),
    "torque_gain": (0.5, 1.5),
    "drive.torque_offset": (-1.0, 1.0),
    "drive.sensor_gain": (0.5, 1.5),
    "load_friction": (0.0, 0.5),
}
"""Widest bounds: by full name, else by the last part, prefixed by ``drive`` for drives."""

_FACTOR = 4.0
"""Parameters without a range may lie between a quarter and four times their start."""


@dataclass(frozen=True)
class Parameter:
    """One number to find.

    Attributes:
        name: Path, e.g. ``"hip.friction"`` or ``"drive.knee.stiffness"``.
        unit: SI.
        start: Where a search begins.
        low: Lower bound.
        high: Upper bound.
        scale: A change that matters; searches work in units of it.

    Raises:
        UsageError: The bounds exclude the start.
    """

    name: str
    unit: str
    start: float
    low: float
    high: float
    scale: float

    def __post_init__(self) -> None:
        if not self.low <= self.start <= self.high or not self.low < self.high:
            raise UsageError(
                f"The bounds of '{self.name}', {self.low:g} to {self.high:g} {self.unit}, exclude"
                f" its start {self.start:g}; widen them or start inside."
            )
        if not 0 < self.scale < math.inf:
            raise UsageError(f"The scale of '{self.name}' is {self.scale} but must be positive.")


@dataclass(frozen=True)
class ParameterSet:
    """Parameters in a fixed order, and everything else about the hypothesis that stays.

    A search's vector is dimensionless: values in units of their scale, counted from the start.
    """

    base: LegHypothesis
    parameters: tuple[Parameter, ...]

    def __post_init__(self) -> None:
        if not self.parameters:
            raise UsageError("There is nothing to fit; name at least one parameter.")
        for name in self.names:
            self.base.get(name)
            if self.names.count(name) > 1:
                raise UsageError(f"The parameter '{name}' is named twice; name it once.")

    @cached_property
    def names(self) -> list[str]:
        """Names in order."""
        return [p.name for p in self.parameters]

    @cached_property
    def scale(self) -> Array:
        """Scales in order, (k,)."""
        return np.array([p.scale for p in self.parameters])

    @cached_property
    def start(self) -> Array:
        """Starting values in order, (k,)."""
        return np.array([p.start for p in self.parameters])

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds in search coordinates, (k,) each."""
        low = np.array([p.low for p in self.parameters])
        high = np.array([p.high for p in self.parameters])
        return (low - self.start) / self.scale, (high - self.start) / self.scale

    def values(self, vector: Array) -> Array:
        """Return physical values of search vectors, (..., k)."""
        return np.asarray(self.start + vector * self.scale)

    def vector(self, values: Array) -> Array:
        """Return the search vector of physical values, (..., k)."""
        return np.asarray((values - self.start) / self.scale)

    def hypotheses(self, vectors: Array) -> list[LegHypothesis]:
        """Return the hypotheses that search vectors stand for; ``vectors`` is (n, k)."""
        low, high = (self.values(b) for b in self.bounds)
        values = np.clip(self.values(vectors), low, high)
        return [self.base.replace(dict(zip(self.names, row, strict=True))) for row in values]


def choose(
    base: LegHypothesis,
    names: Sequence[str],
    *,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    start: Mapping[str, float] | None = None,
) -> ParameterSet:
    """Return a set of parameters with sensible bounds and scales.

    Args:
        base: LegHypothesis with the starting values; a drive's gain that it leaves to the recording
            needs a ``start``.
        names: What to fit.
        bounds: Bounds that differ from the widest ones.
        start: Starting values that differ from the hypothesis's.

    Raises:
        UsageError: A name does not exist, or bounds exclude the start.
    """
    units = parameter_units(base)
    parameters = []
    for name in names:
        value = (start or {}).get(name, base.get(name))
        if math.isnan(value):
            raise UsageError(f"'{name}' has no value to start from; give one.")
        low, high = (bounds or {}).get(name) or _range(name, value)
        if value == low == 0.0 or math.isclose(value, low, rel_tol=1e-12):
            scale = 0.02 * (high - low)
        else:
            scale = max(0.3 * abs(value), 1e-3 * (high - low))
        parameters.append(Parameter(name, units[name], value, low, high, scale))
    return ParameterSet(base, tuple(parameters))


def narrowed(
    parameters: ParameterSet, values: Iterable[float], factor: float, names: Iterable[str]
) -> ParameterSet:
    """Return the set started at found values, some of them bounded around those.

    Args:
        parameters: The set whose search found the values.
        values: In the set's order.
        factor: A bound is the value divided or multiplied by this, inside the former bounds.
        names: Which parameters get such bounds.
    """
    chosen, start, bounds = set(names), {}, {}
    for p, value in zip(parameters.parameters, values, strict=True):
        start[p.name] = float(value)
        low, high = p.low, p.high
        if p.name in chosen:
            reach = 0.1 * p.scale
            low = max(low, min(value / factor, value * factor, value - reach))
            high = min(high, max(value / factor, value * factor, value + reach))
        bounds[p.name] = (low, high)
    return choose(parameters.base, parameters.names, bounds=bounds, start=start)


def _range(name: str, value: float) -> tuple[float, float]:
    last = name.rsplit(".", 1)[-1]
    short = f"drive.{last}" if name.startswith("drive.") else last
    known = _RANGES.get(name) or _RANGES.get(short)
    if known is None:
        ends = sorted((value / _FACTOR, value * _FACTOR))
        return ends[0], ends[1]
    return min(known[0], value), max(known[1], value)
