"""What a fit may change, the robot and its actuators, and the named numbers that it searches."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from functools import cache, cached_property
from operator import attrgetter
from typing import Any, get_type_hints

import numpy as np

from hopping_leg.arrays import Array, BoolArray
from hopping_leg.errors import UsageError, unknown_name
from hopping_leg.io import quantity, replace_at
from hopping_leg.robot import COARSE_TIMESTEP, JOINTS, Robot
from hopping_leg.sim.leg_table import stiffest

STIFFNESS = tuple(f"reality.{joint}.stiffness" for joint in JOINTS)
"""Of the joints' transmissions, rigid where the robot states none."""


@dataclass(frozen=True)
class ActuatorParameters:
    """One joint's drive at the joint's side; NaN takes what the recording says."""

    stiffness: float = quantity("N m/rad", math.nan)
    damping: float = quantity("N m s/rad", math.nan)
    integral: float = quantity("N m/(rad s)", math.nan)
    sensor_gain: float = quantity("1", 1.0)
    """Measured torque per true torque."""
    torque_limit: float = quantity("N m", math.nan)
    """Of what its own loop asks for, on this rig."""


@dataclass(frozen=True)
class Actuators:
    """Both drives and what they share."""

    hip: ActuatorParameters = field(default_factory=ActuatorParameters)
    knee: ActuatorParameters = field(default_factory=ActuatorParameters)
    delay: float = quantity("s", 0.0)
    """From a command's time stamp to its effect."""
    creep: float = quantity("rad/s", 0.0)
    """Speed that a joint has where its dry friction is only just there; 0 holds it still."""
    ramp: float = quantity("1", 0.0)
    """Share of the commanded velocity by which a drive moves its position target on until the
    next command: 0 holds the target, 1 ramps it as mjbots' moteus does."""


@dataclass(frozen=True)
class LegHypothesis:
    """A robot and its drives: all that a simulation of a recording needs.

    Parameters are named by their path: ``"hip.friction"`` as in the robot file,
    ``"drive.hip.stiffness"`` for what is not the robot's.
    """

    robot: Robot
    drive: Actuators = field(default_factory=Actuators)

    def get(self, name: str) -> float:
        """Return a parameter's value, NaN for none; UsageError if there is no such parameter."""
        value = attrgetter(self._path(name))(self)
        return math.nan if value is None else float(value)

    def replace(self, values: Mapping[str, float]) -> "LegHypothesis":
        """Return the hypothesis with other values of parameters; UsageError if one is unknown."""
        hypothesis = self
        for name, value in values.items():
            hypothesis = replace_at(hypothesis, self._path(name), float(value))
        return hypothesis

    def _path(self, name: str) -> str:
        if name not in parameter_units():
            raise UsageError(unknown_name("parameter", name, parameter_units()))
        return name if name.startswith("drive.") else f"robot.{name}"


@cache
def parameter_units() -> Mapping[str, str]:
    """Return every parameter's name and unit."""
    return _units(Robot) | _units(Actuators, "drive.")


def _units(kind: type[Any], prefix: str = "") -> dict[str, str]:
    hints = get_type_hints(kind)
    found: dict[str, str] = {}
    for spec in fields(kind):
        if is_dataclass(hints[spec.name]):
            found |= _units(hints[spec.name], f"{prefix}{spec.name}.")
        elif "unit" in spec.metadata:
            found[prefix + spec.name] = spec.metadata["unit"]
    return found


_RANGES = {
    "rail.friction": (0.0, 10.0), "rail.damping": (0.0, 20.0),
    "contact.time_constant": (2 * COARSE_TIMESTEP, 0.2), "contact.damping_ratio": (0.1, 3.0),
    "contact.friction": (0.2, 2.0), "friction": (0.0, 1.0), "damping": (0.0, 1.0),
    "armature": (1e-6, 0.05), "drive.delay": (0.0, 0.02), "drive.creep": (0.0, 0.1),
    "drive.ramp": (0.0, 1.0), "drive.stiffness": (0.0, 2000.0), "drive.damping": (0.0, 50.0),
    "drive.integral": (0.0, 100.0), "torque_gain": (0.5, 1.5), "drive.sensor_gain": (0.5, 1.5),
    "load_friction": (0.0, 0.5), "backlash": (0.0, 0.02), "efficiency": (0.5, 1.0),
    "boom.mass": (-0.6, 0.6), "boom.forward_mass": (-0.6, 1.0), "boom.weight": (-5.0, 5.0),
    "boom.hip_friction": (0.0, 1.0), "boom.friction": (0.0, 3.0), "boom.damping": (0.0, 10.0),
    "stiffness_damping": (0.0, 0.5),
}  # fmt: skip
"""Widest bounds: by full name, else by the last part, prefixed by ``drive`` for drives."""
_ROUGH = 10.0  # scale of a stiffness over it: the cost is so rough that slopes need 1 % of it
_FACTOR = 4.0  # parameters without a range may lie between a quarter and four times their start


@dataclass(frozen=True)
class Parameter:
    """One number to find, named as ``LegHypothesis`` says; its bounds must hold its start."""

    name: str
    unit: str
    start: float
    low: float
    high: float
    scale: float
    """A change that matters at the start; searches work in units of it."""

    def __post_init__(self) -> None:
        if not self.low <= self.start <= self.high or not self.low < self.high:
            raise UsageError(
                f"The bounds of '{self.name}', {self.low:g} to {self.high:g} {self.unit}, exclude"
                f" its start {self.start:g}; widen them or start inside."
            )


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
        if twice := [name for name in self.names if self.names.count(name) > 1]:
            raise UsageError(f"The parameter '{twice[0]}' is named twice; name it once.")

    @cached_property
    def names(self) -> list[str]:
        """Names in order."""
        return [p.name for p in self.parameters]

    @cached_property
    def scale(self) -> Array:
        """Scales in order, (k,)."""
        return np.array([p.scale for p in self.parameters])

    def scale_at(self, vector: Array) -> Array:
        """Return by how much values change per unit of a search vector, (k,)."""
        start = np.where(self.shares, self.start, 1.0)
        return np.where(self.shares, self.values(vector) / start, 1.0) * self.scale

    @cached_property
    def shares(self) -> BoolArray:
        """Which are searched in shares of their value, (k,): stiffnesses of transmissions."""
        return np.array([name in STIFFNESS for name in self.names])

    @cached_property
    def start(self) -> Array:
        """Starting values in order, (k,)."""
        return np.array([p.start for p in self.parameters])

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds in search coordinates, (k,) each."""
        low, high = np.array([(p.low, p.high) for p in self.parameters]).T
        return self.vector(low), self.vector(high)

    def values(self, vector: Array) -> Array:
        """Return physical values of search vectors, (..., k)."""
        values, shares, start = self.start + vector * self.scale, self.shares, self.start
        values[..., shares] = start[shares] * np.exp(values[..., shares] / start[shares] - 1)
        return np.asarray(values)

    def vector(self, values: Array) -> Array:
        """Return the search vector of physical values, (..., k)."""
        values, shares, start = np.array(values), self.shares, self.start
        values[..., shares] = start[shares] * (1 + np.log(values[..., shares] / start[shares]))
        return np.asarray((values - start) / self.scale)

    def hypotheses(self, vectors: Array) -> list[LegHypothesis]:
        """Return the hypotheses that search vectors stand for; ``vectors`` is (n, k)."""
        low, high = (self.values(b) for b in self.bounds)
        values = np.clip(self.values(vectors), low, high)
        return [_simulable(self.base, dict(zip(self.names, v, strict=True))) for v in values]


def choose(
    base: LegHypothesis,
    names: Sequence[str],
    *,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    start: Mapping[str, float] | None = None,
) -> ParameterSet:
    """Return a set of parameters with sensible bounds and scales.

    ``bounds`` differ from the widest ones; ``start`` has values that differ from the base's.
    """
    units = parameter_units()
    parameters = []
    for name in names:
        value = (start or {}).get(name, base.get(name))
        if math.isnan(value):
            raise UsageError(f"'{name}' has no value to start from; give one.")
        joint, _, last = name.rpartition(".")
        short = f"drive.{last}" if joint.startswith("drive") else last
        known = _RANGES.get(name) or _RANGES.get(short)
        widest = known or sorted((value / _FACTOR, value * _FACTOR))
        widest = min(widest[0], value), max(widest[1], value)
        low, high = (bounds or {}).get(name) or widest
        at_low = value == low == 0.0 or math.isclose(value, low, rel_tol=1e-12)
        scale = 0.02 * (high - low) if at_low else max(0.3 * abs(value), 1e-3 * (high - low))
        if name in STIFFNESS:
            low, scale = max(low, 1e-3 * value), _ROUGH * value
        parameters.append(Parameter(name, units[name], value, low, high, scale))
    return ParameterSet(base, tuple(parameters))


def _simulable(base: LegHypothesis, values: Mapping[str, float]) -> LegHypothesis:
    """Return a hypothesis with other values, and no stiffer than the physics step allows."""
    found = base.replace(values)
    most = (stiffest(found.robot, joint, COARSE_TIMESTEP) for joint in JOINTS)
    return found.replace({n: m for n, m in zip(STIFFNESS, most, strict=True) if found.get(n) > m})
