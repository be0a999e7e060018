"""Twins: legs that play the real one, drawn from a stated distribution.

A twin differs from the robot it extends in what a fit can find (friction, inertia, ground) and in
what it cannot (``[reality]``). Ranges span what is known of leg V2: CAD, the lab's own
identification, the paper's Table I, recordings. Whoever doubts them passes others.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hopping_leg.errors import UsageError
from hopping_leg.io import Tree, replace_at, write_atomically
from hopping_leg.robot import Robot, robot_from_tree, robot_text, shipped_robots
from hopping_leg.sim.randomization import IDENTIFIABLE_RANGES, Range

_CHOSEN = "[C]"


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


MISMATCH_RANGES = (
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

TWIN_RANGES = IDENTIFIABLE_RANGES + MISMATCH_RANGES
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
        value = float(f"{spread.sample(rng):.6g}")
        tree = replace_at(tree, spread.path, _entry(spread, value, seed))
    return Twin(robot_from_tree(tree, f"twin {seed}"), tree)


def _entry(spread: Range, value: float, seed: int) -> Tree:
    drawn = f"seed {seed}, {spread.scale} from {spread.low:g} to {spread.high:g}"
    fixed = spread.low == spread.high
    source = spread.source if fixed else f"{drawn}: {spread.source}"
    return {"value": value, "unit": spread.unit, "source": source}
