"""Twins: legs that play the real one, drawn from a stated distribution.

A twin differs from the robot it extends in what a fit can find (friction, inertia, ground) and in
what it cannot (``[reality]``). Ranges span what is known of leg V2: CAD, the lab's own
identification, the paper's Table I, recordings. Whoever doubts them passes others.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from hopping_leg.errors import UsageError
from hopping_leg.robot.fields import Tree
from hopping_leg.robot.files import robot_from_tree, shipped_robots
from hopping_leg.robot.parameters import Robot
from hopping_leg.robot.writing import robot_text
from hopping_leg.trace import write_atomically


@dataclass(frozen=True)
class Range:
    """Where a number of a robot file may lie.

    Raises:
        UsageError: The range is empty, or logarithmic and not positive.
    """

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

    def draw(self, rng: np.random.Generator, own: float = 0.0) -> float:
        """Return one value.

        Args:
            rng: Source of randomness.
            own: What the robot itself has.
        """
        drawn = self._draw(rng)
        if self.bounds == "values":
            return drawn
        return own * drawn if self.bounds == "factors" else own + drawn

    def _draw(self, rng: np.random.Generator) -> float:
        if self.scale == "uniform":
            drawn = float(rng.uniform(self.low, self.high))
        else:
            drawn = float(math.exp(rng.uniform(math.log(self.low), math.log(self.high))))
        return round(drawn / self.step) * self.step if self.step else drawn

    def place(self, value: float, own: float = 0.0) -> float:
        """Return where a value lies in the range, -1 at its lower and 1 at its upper bound.

        Args:
            value: As drawn.
            own: What the robot itself has; no factor of zero lies anywhere but in the middle.
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
_CHOSEN = "[C]"

IDENTIFIABLE = (
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


def _drives() -> tuple[Range, ...]:
    ranges: list[Range] = []
    for name, belt in (("hip", 1.0), ("knee", 2.0)):
        at = f"reality.{name}"
        gear = "[M] qdd100 +-0.1 deg at its output"
        noise = {"hip": (1.4e-4, 0.09, 0.06), "knee": (4e-5, 0.04, 0.03)}[name]
        steps = (6.4e-5 / belt, 0.0, 0.0)
        ranges += [
            Range(f"{at}.torque_gain", "1", 0.9, 1.0, "[R] boom recordings 0.91"),
            Range(f"{at}.torque_lag", "s", 5e-4, 2e-3, f"{_CHOSEN} current loop; [R] V1 3 ms"),
            Range(f"{at}.ripple", "N m", 0.01 * belt, 0.08 * belt, f"{_CHOSEN} below [R] noise"),
            Range(
                f"{at}.ripple_periods", "1", 252 * belt, 252 * belt, f"{_CHOSEN} 42 a rotor turn"
            ),
            Range(f"{at}.efficiency", "1", 0.9, 0.98, f"{_CHOSEN} one planetary stage"),
            Range(f"{at}.stiction", "1", 1.0, 1.6, f"{_CHOSEN} greased gear"),
            Range(f"{at}.backlash", "rad", 2e-3 / belt, 7e-3 / belt, f"around {gear}"),
        ]
        ranges += [
            Range(f"{at}.sensor.{kind}_noise", unit, value, value, "[R] standing noise, leg V2")
            for kind, unit, value in zip(
                ("position", "velocity", "torque"), ("rad", "rad/s", "N m"), noise, strict=True
            )
        ]
        ranges.append(
            Range(
                f"{at}.sensor.position_step", "rad", steps[0], steps[0], "[M] 14 bit at the rotor"
            )
        )
    return tuple(ranges)


UNKNOWN = (
    Range("reality.voltage", "1", 0.85, 1.0, f"{_CHOSEN} a battery from full to nearly empty"),
    Range("reality.latency.command", "s", 1e-3, 4e-3, f"{_CHOSEN} bus cycle and computer"),
    Range("reality.latency.measurement", "s", 0.0, 1.5e-3, f"{_CHOSEN} bus cycle"),
    Range("reality.latency.jitter", "s", 0.0, 1e-3, f"{_CHOSEN} computer without real time"),
    *_drives(),
    Range(
        "reality.knee.stiffness", "N m/rad", 150.0, 600.0, f"{_CHOSEN} timing belt", "logarithmic"
    ),
    Range("reality.knee.stiffness_damping", "N m s/rad", 0.01, 0.05, f"{_CHOSEN} rubber"),
    Range("reality.mass.base", "1", 0.97, 1.03, f"{_CHOSEN} cables and screws"),
    Range("reality.mass.thigh", "1", 0.97, 1.03, f"{_CHOSEN} cables and screws"),
    Range("reality.mass.shank", "1", 0.95, 1.05, f"{_CHOSEN} cables and screws"),
)
"""What the simulator for training does not know."""

TWIN_RANGES = IDENTIFIABLE + UNKNOWN
"""The distribution of twins."""


@dataclass(frozen=True)
class Twin:
    """A drawn twin.

    Attributes:
        robot: What is simulated.
        tree: Its file: what it extends and every number drawn, with its range as source.
    """

    robot: Robot
    tree: Tree

    def save(self, path: Path) -> None:
        """Write the robot file.

        Raises:
            TraceError: The file cannot be written.
        """
        write_atomically(path, robot_text(self.tree).encode())


def draw_twin(seed: int, base: str = "legv2", ranges: Sequence[Range] = TWIN_RANGES) -> Twin:
    """Draw a twin; the same seed gives the same twin.

    Args:
        seed: 0 or more.
        base: Shipped robot or file that it extends: what is believed before identification.
        ranges: What is drawn, in this order.

    Raises:
        RobotError: There is no such robot, or a drawn number contradicts it.
        UsageError: The seed is negative.
    """
    if seed < 0:
        raise UsageError(f"A seed of {seed} has no meaning; give 0 or more.")
    rng = np.random.default_rng(seed)
    parent = base if base in shipped_robots() else str(Path(base).resolve())
    tree: Tree = {
        "name": f"twin-{seed}",
        "description": f"twin {seed} of {Path(base).stem}, drawn",
        "extends": parent,
    }
    for spread in ranges:
        _put(tree, spread, float(f"{spread.draw(rng):.6g}"), seed)
    return Twin(robot_from_tree(tree, f"twin {seed}"), tree)


def _put(tree: Tree, spread: Range, value: float, seed: int) -> None:
    table: dict[str, Any] = tree
    *tables, name = spread.path.split(".")
    for key in tables:
        table = table.setdefault(key, {})
    drawn = f"seed {seed}, {spread.scale} from {spread.low:g} to {spread.high:g}"
    fixed = spread.low == spread.high
    source = spread.source if fixed else f"{drawn}: {spread.source}"
    table[name] = {"value": value, "unit": spread.unit, "source": source}
