"""The paper's trials: what is commanded when (Sec. III)."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.errors import UsageError
from hopping_leg.robot import kinematics
from hopping_leg.robot.parameters import Robot

COMMANDS = (0.25, 0.30, 0.35)
"""Apex heights the paper trains and tests, m, for a leg of ``PAPER_HEIGHT``."""

STAIRCASE = (0.25, 0.27, 0.29, 0.31, 0.33, 0.35)
"""Commands of the 30 s trial, m, 5 s each (Fig. 5)."""

LADDER = (0.22, 0.24, 0.26, 0.28, 0.30, 0.32, 0.34, 0.36, 0.38, 0.40)
"""Commands that show how a controller interpolates and where it ends, m."""

PAPER_HEIGHT = 0.30
"""Straight height of the leg that the paper's commands were made for, m."""

KINDS = ("fixed", "sequence", "staircase", "ladder")
"""Kinds of trial."""

FIXED_SECONDS = 15.0
STEP_SECONDS = 5.0


@dataclass(frozen=True)
class Trial:
    """One command schedule, started from standing.

    Attributes:
        kind: One of ``KINDS``.
        steps: (command in m, duration in s) in order.
    """

    kind: str
    steps: tuple[tuple[float, float], ...]

    @property
    def name(self) -> str:
        """Short and unique within an evaluation, fit for a file name."""
        return f"{self.kind}-{self.steps[0][0]:.3f}" if len(self.steps) == 1 else self.kind

    @property
    def seconds(self) -> float:
        """Duration, s."""
        return sum(seconds for _, seconds in self.steps)

    def commands(self, rate: float) -> Array:
        """Return the command of every control period, m, (ticks,).

        Args:
            rate: Control rate, Hz.
        """
        return np.concatenate([np.full(round(s * rate), height) for height, s in self.steps])


def scaled(heights: Sequence[float], robot: Robot) -> tuple[float, ...]:
    """Return the paper's heights for a leg of another size, m, rounded to 5 mm."""
    ratio = robot.straight_height / PAPER_HEIGHT
    return tuple(round(h * ratio * 200) / 200 for h in heights)


def paper_trials(robot: Robot, commands: Sequence[float] | None = None) -> list[Trial]:
    """Return all trials of an evaluation.

    Args:
        robot: The leg; the paper's heights scale with its length.
        commands: Heights of the fixed trials and the sequence, m; the paper's by default.

    Raises:
        UsageError: A command is out of the leg's reach.
    """
    chosen = scaled(COMMANDS, robot) if commands is None else tuple(sorted(set(commands)))
    check_reach(robot, chosen)
    trials = [Trial("fixed", ((c, FIXED_SECONDS),)) for c in chosen]
    if len(chosen) > 1:
        trials.append(Trial("sequence", tuple((c, STEP_SECONDS) for c in chosen)))
    trials.append(Trial("staircase", tuple((c, STEP_SECONDS) for c in scaled(STAIRCASE, robot))))
    trials += [Trial("ladder", ((c, FIXED_SECONDS),)) for c in scaled(LADDER, robot)]
    return trials


def reach(robot: Robot) -> tuple[float, float]:
    """Return the heights a leg can be asked for, m: folded standing to twice its length."""
    folded = np.array([robot.hip.upper, robot.knee.lower])
    return float(kinematics.stance_height(robot, folded)), 2 * robot.straight_height


def check_reach(robot: Robot, commands: Sequence[float]) -> None:
    """Refuse heights that no controller can make this leg hop to.

    Raises:
        UsageError: Naming the height and the range.
    """
    low, high = reach(robot)
    if not commands:
        raise UsageError("No commands were given; give heights in m, e.g. --commands 0.25,0.30.")
    for height in commands:
        if not math.isfinite(height) or not low <= height <= high:
            raise UsageError(
                f"A command of {height:g} m is out of reach of {robot.name}; give heights of the"
                f" hip axis from {low:.2f} to {high:.2f} m."
            )


def within(trial: Trial, bounds: tuple[float, float] | None) -> bool:
    """Tell whether all commands of a trial lie within a controller's range."""
    slack = 1e-9
    return bounds is None or all(
        bounds[0] - slack <= c <= bounds[1] + slack for c, _ in trial.steps
    )
