"""Legs that differ: the same robot with numbers drawn anew for each, for domain randomisation.

The paper fits one simulation to the robot and rejects the alternative, training on many; this is
that alternative. Controllers and rewards go on believing the robot itself, so only what the physics
alone reads may vary: sizes, motors' speeds and joint limits may not.

Twins are drawn, too: legs that play the real one. A twin differs from the robot it extends in what
a fit can find (friction, inertia, ground) and in what it cannot (``[reality]``). Ranges span what
is known of leg V2: CAD, the lab's own identification, the paper's Table I, recordings.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from operator import attrgetter
from pathlib import Path
from typing import Literal

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.errors import UsageError, unknown_name
from hopping_leg.io import Tree, replace_at, write_atomically
from hopping_leg.robot import (
    JOINTS,
    STANDING_NOISE,
    Robot,
    check_physics,
    robot_from_tree,
    robot_text,
    shipped_robots,
)  # fmt: skip

RANDOMIZABLE = (
    "base.mass",
    "rail.friction",
    "rail.damping",
    *(f"{link}.{name}" for link in ("thigh", "shank") for name in ("mass", "com", "inertia")),
    *(f"contact.{name}" for name in ("time_constant", "damping_ratio", "friction")),
    *(
        f"{joint}.{name}"
        for joint in JOINTS
        for name in ("friction", "damping", "armature", "load_friction", "torque_gain")
    ),
    "reality.latency.command",
)
"""Numbers of a robot that may differ from leg to leg; the latency by whole control periods."""


@dataclass(frozen=True)
class Range:
    """Where a number of a robot file may lie; UsageError where it can lie nowhere."""

    path: str
    """Dotted path in the file."""
    unit: str
    low: float
    high: float
    source: str
    """Why these bounds."""
    scale: Literal["uniform", "logarithmic"] = "uniform"
    bounds: Literal["values", "factors", "additions"] = "values"
    """Whether the bounds are the number's own, or factors of or additions to what a robot has."""
    step: float = 0.0
    """Only whole multiples of this are drawn, 0 for any number."""

    def __post_init__(self) -> None:
        least = 0.0 if self.scale == "logarithmic" else -math.inf
        if not least < self.low <= self.high < math.inf:
            raise UsageError(
                f"The {self.scale} range of '{self.path}' is {self.low:g} to {self.high:g}"
                f" {self.unit}; its bounds must rise and be finite, and positive if logarithmic."
            )

    def sample(self, rng: np.random.Generator, own: float = 0.0) -> float:
        """Return one value; ``own`` is what the robot itself has."""
        if self.scale == "uniform":
            drawn = float(rng.uniform(self.low, self.high))
        else:
            drawn = float(math.exp(rng.uniform(math.log(self.low), math.log(self.high))))
        drawn = round(drawn / self.step) * self.step if self.step else drawn
        if self.bounds == "values":
            return drawn
        return own * drawn if self.bounds == "factors" else own + drawn

    def normalize(self, value: float, own: float = 0.0) -> float:
        """Return where a value lies in the range, -1 at its lower and 1 at its upper bound.

        ``own`` is what the robot has; no factor of zero lies anywhere but in the middle.
        """
        if self.bounds == "factors":
            if own == 0:
                return 0.0
            value = value / own
        elif self.bounds == "additions":
            value = value - own
        ends = (self.low, value, self.high)
        low, at, high = ends if self.scale == "uniform" else map(math.log, ends)
        return 2 * (at - low) / (high - low) - 1 if high > low else 0.0


_TABLE = "[P] Table I"
_LAB = "[V2] lab's least squares"

IDENTIFIABLE_RANGES = (
    Range("rail.friction", "N", 0.3, 1.2, f"around {_TABLE}"),
    Range("rail.damping", "N s/m", 0.5, 1.6, f"around {_TABLE}"),
    Range("thigh.inertia", "kg m2", 1.2e-3, 4.1e-3, f"CAD to {_TABLE}", "logarithmic"),
    Range("shank.inertia", "kg m2", 1e-4, 1e-3, f"CAD to {_LAB}", "logarithmic"),
    Range("contact.time_constant", "s", 0.02, 0.09, f"MuJoCo's to {_TABLE}", "logarithmic"),
    Range("contact.damping_ratio", "1", 0.65, 1.0, f"{_TABLE} to MuJoCo's"),
    Range("hip.friction", "N m", 0.04, 0.44, f"{_LAB} to {_TABLE}", "logarithmic"),
    Range("hip.damping", "N m s/rad", 5e-4, 1e-2, f"{_TABLE} to {_LAB}", "logarithmic"),
    Range("hip.armature", "kg m2", 1.8e-3, 3.8e-3, f"CAD to {_LAB}; {_TABLE} is below the rotor's"),
    Range("knee.friction", "N m", 1.5e-3, 5e-2, f"{_TABLE} to twice {_LAB}", "logarithmic"),
    Range("knee.damping", "N m s/rad", 0.03, 0.15, f"{_LAB} to {_TABLE}", "logarithmic"),
    Range("knee.armature", "kg m2", 7e-3, 1.5e-2, "as hip.armature, behind the belt"),
)
"""What the simulator for training knows and a fit can find."""


def times(path: str, low: float, high: float) -> Range:
    """Return the range of a number that is multiplied with a factor."""
    return Range(path, "1", low, high, "[C]", "logarithmic", "factors")


WIDE_RANGES = (
    times("base.mass", 0.7, 1.6),
    *(times(f"{link}.{n}", 0.6, 2.0) for link in ("thigh", "shank") for n in ("mass", "inertia")),
    times("rail.friction", 0.3, 6.0),
    times("rail.damping", 0.3, 6.0),
    times("contact.time_constant", 0.22, 2.8),
    times("contact.damping_ratio", 0.4, 2.5),
    times("hip.torque_gain", 1 / 1.3, 1.3),
    times("knee.torque_gain", 1 / 1.3, 1.3),
    *(Range(f"{joint}.friction", "N m", 0.0, 1.4, "[C]") for joint in JOINTS),
    Range("reality.latency.command", "s", 0.0, 0.0149, "[C]", bounds="additions", step=5e-3),
)
"""What may surprise any leg: a payload, heavy links, a worn or dry rail, hard and soft ground,
motors that give less or more than they should, joints with friction, commands that arrive later."""


def sample(
    robot: Robot, ranges: Sequence[Range], count: int, rng: np.random.Generator
) -> tuple[Robot, ...]:
    """Return ``count`` variants of a robot, each with its own numbers, drawn range by range.

    UsageError names a number that may not differ from leg to leg, RobotError a drawn one that
    contradicts the robot.
    """
    for spread in ranges:
        if spread.path not in RANDOMIZABLE:
            raise UsageError(unknown_name("number that may vary", spread.path, RANDOMIZABLE))
    variants = []
    for number in range(count):
        variant = robot
        for spread in ranges:
            value = spread.sample(rng, attrgetter(spread.path)(robot))
            variant = replace_at(variant, spread.path, value)
        check_physics(variant, f"variant {number} of {robot.name}")
        variants.append(variant)
    return tuple(variants)


def normalized(robot: Robot, variants: Sequence[Robot], ranges: Sequence[Range]) -> Array:
    """Return where the numbers of a robot's variants lie in their ranges, -1 to 1, (n, ranges)."""
    found = np.empty((len(variants), len(ranges)))
    for column, spread in enumerate(ranges):
        number = attrgetter(spread.path)
        found[:, column] = [spread.normalize(number(v), number(robot)) for v in variants]
    return found


_BACKLASH = "around [M] qdd100 +-0.1 deg at its output"
_ENCODER = "[M] 14 bit at the rotor"
_NOISE = "[R] standing noise, leg V2"


def _drives() -> tuple[Range, ...]:
    kinds = (("position", "rad"), ("velocity", "rad/s"), ("torque", "N m"))
    return tuple(
        Range(f"reality.{joint}.{name}", unit, low, high, source)
        for joint, belt, sensor in zip(JOINTS, (1.0, 2.0), STANDING_NOISE, strict=True)
        for name, unit, low, high, source in (
            ("torque_gain", "1", 0.9, 1.0, "[R] boom recordings 0.91"),
            ("torque_lag", "s", 5e-4, 2e-3, "[C] current loop; [R] V1 3 ms"),
            ("ripple", "N m", 0.01 * belt, 0.08 * belt, "[C] below [R] noise"),
            ("ripple_periods", "1", 252 * belt, 252 * belt, "[C] 42 a rotor turn"),
            ("efficiency", "1", 0.9, 0.98, "[C] one planetary stage"),
            ("stiction", "1", 1.0, 1.6, "[C] greased gear"),
            ("backlash", "rad", 2e-3 / belt, 7e-3 / belt, _BACKLASH),
            *(
                (f"sensor.{kind}_noise", unit, *[getattr(sensor, f"{kind}_noise")] * 2, _NOISE)
                for kind, unit in kinds
            ),
            ("sensor.position_step", "rad", 6.4e-5 / belt, 6.4e-5 / belt, _ENCODER),
        )
    )


MISMATCH_RANGES = (
    Range("reality.voltage", "1", 0.85, 1.0, "[C] a battery from full to nearly empty"),
    Range("reality.latency.command", "s", 1e-3, 4e-3, "[C] bus cycle and computer"),
    Range("reality.latency.measurement", "s", 0.0, 1.5e-3, "[C] bus cycle"),
    Range("reality.latency.jitter", "s", 0.0, 1e-3, "[C] computer without real time"),
    *_drives(),
    Range("reality.hip.stiffness", "N m/rad", 800.0, 2000.0, "[C] planetary stage", "logarithmic"),
    Range("reality.hip.stiffness_damping", "N m s/rad", 0.02, 0.1, "[C] grease"),
    Range("reality.knee.stiffness", "N m/rad", 150.0, 600.0, "[C] timing belt", "logarithmic"),
    Range("reality.knee.stiffness_damping", "N m s/rad", 0.01, 0.05, "[C] rubber"),
    Range("reality.mass.base", "1", 0.97, 1.03, "[C] cables and screws"),
    Range("reality.mass.thigh", "1", 0.97, 1.03, "[C] cables and screws"),
    Range("reality.mass.shank", "1", 0.95, 1.05, "[C] cables and screws"),
)
"""What the simulator for training does not know."""

TWIN_RANGES = IDENTIFIABLE_RANGES + MISMATCH_RANGES  # The distribution of twins


@dataclass(frozen=True)
class Twin:
    """A drawn twin and its file, with the range of each drawn number as its source."""

    robot: Robot
    tree: Tree

    def save(self, path: Path) -> None:
        """Write the robot file, or raise TraceError."""
        write_atomically(path, robot_text(self.tree).encode())


def draw_twin(seed: int, base: str = "legv2", ranges: Sequence[Range] = TWIN_RANGES) -> Twin:
    """Draw a twin of a robot; the same seed, 0 or more, gives the same twin.

    ``base`` is the shipped robot or file that it extends: what is believed before identification.
    RobotError says that there is none, or that a drawn number contradicts it.
    """
    rng = np.random.default_rng(seed)
    parent = base if base in shipped_robots() else str(Path(base).resolve())
    description = f"twin {seed} of {Path(base).stem}, drawn"
    tree: Tree = {"name": f"twin-{seed}", "description": description, "extends": parent}
    for spread in ranges:
        value, source = float(f"{spread.sample(rng):.6g}"), spread.source
        if spread.low < spread.high:
            drawn = f"seed {seed}, {spread.scale} from {spread.low:g} to {spread.high:g}"
            source = f"{drawn}: {source}"
        entry = {"value": value, "unit": spread.unit, "source": source}
        tree = replace_at(tree, spread.path, entry)
    return Twin(robot_from_tree(tree, f"twin {seed}"), tree)
