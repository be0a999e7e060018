"""The stages of a distillation, each with a score that it has to reach.

First the teacher alone has to hop: heights that it does not reach, on this robot, are not asked of
the student. Then the student hops, at first with the teacher's help, then alone, and at last its
command is calibrated.
"""

import itertools
from dataclasses import dataclass
from typing import Any

from hopping_leg.controllers.mpc import TrueStateMpc
from hopping_leg.errors import UsageError
from hopping_leg.rl.distillation.dagger import DaggerConfig
from hopping_leg.rl.onnx_export import every_centimetre
from hopping_leg.rl.policy_evaluation import CommandResult, command_score, evaluate_policy
from hopping_leg.rl.recipe import Recipe
from hopping_leg.robot.parameters import Robot

_REACHED = 0.005
"""Median error with which the teacher reaches a height, m."""


@dataclass(frozen=True)
class Stage:
    """A part of a distillation."""

    name: str
    until: float
    """Share of the training with which it ends."""
    score: str
    """What decides, in words; in m, less is better."""
    must_score: float
    """Largest score with which it is passed, m."""

    def ended(self, score: float, seconds: float) -> dict[str, Any]:
        """Return its result after so much time, s, as JSON values."""
        return {
            "name": self.name,
            "until": self.until,
            "score": self.score,
            "must_score_m": self.must_score,
            "score_m": score,
            "passed": score <= self.must_score,
            "seconds": seconds,
        }


def stages_of(recipe: Recipe) -> tuple[Stage, ...]:
    """Return the stages of a distillation in order; no other recipe has any."""
    if not isinstance(recipe.algorithm, DaggerConfig):
        return ()
    worst = "median error and scatter at the worst height"
    helped = 0.15 if recipe.legs == "any" else 0.03  # legs of any size take longer
    return (
        Stage("teacher", 0.0, worst, 0.006),
        Stage("student, helped", recipe.algorithm.mixing_share, "mean error of its hops", helped),
        Stage("student, alone", 1.0, worst, 0.030),
        Stage("student, calibrated", 1.0, worst, 0.010),
    )


def within_reach(recipe: Recipe, robot: Robot) -> tuple[Recipe, float]:
    """Return a recipe for the heights that its teacher reaches, and the teacher's worst score, m.

    A recipe without a teacher stays as it is. The heights are the longest run of centimetres
    without a skipped hop and with a small median error.

    Raises:
        UsageError: There are none.
    """
    if not isinstance(recipe.algorithm, DaggerConfig):
        return recipe, 0.0
    rate, heights = recipe.task.rate, every_centimetre(recipe.task.command_bounds)
    teacher = TrueStateMpc(robot, recipe.algorithm.teacher, rate=rate)
    results = evaluate_policy(teacher, robot, heights, rate=rate, legs=2, seconds=5.0)
    runs = [list(run) for reached, run in itertools.groupby(results, key=_is_reached) if reached]
    longest = max(runs, key=len, default=[])
    if len(longest) < 3:
        raise UsageError(
            f"The teacher reaches no range of heights between {heights[0]:g} and {heights[-1]:g} m"
            f" on {robot.name}; check masses, lengths and motors with `hop robots check`, or give"
            " other --heights."
        )
    if len(longest) < len(heights):
        recipe = recipe.within(longest[0].command_m, longest[-1].command_m)
    return recipe, max(map(command_score, longest))


def _is_reached(result: CommandResult) -> bool:
    hops = result.hops > 0 and result.skipped_hops == 0
    return hops and abs(result.median_error_m) <= _REACHED
