"""What each part of `fast` is worth.

Every variant is trained with several seeds for the same number of steps and judged on seeds that
chose nothing.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from hopping_leg.cli.options import JsonFile, RobotFile, at_least
from hopping_leg.controllers.policy import Card
from hopping_leg.envs.observation import make_observation
from hopping_leg.errors import UsageError, unknown_name
from hopping_leg.evaluate.runner import software_versions
from hopping_leg.rl.onnx_export import build_policy
from hopping_leg.rl.policy_evaluation import calibrate
from hopping_leg.rl.reach import within_reach
from hopping_leg.rl.recipe import Recipe
from hopping_leg.rl.recipes.fast import FAST
from hopping_leg.robot import DEFAULT_ROBOT, Robot, load_robot
from studies.shared import Row, once, show_rows
from studies.time_to_accuracy.run import JUDGING_SEEDS, judge

VARIANTS: dict[str, tuple[str, dict[str, Any]]] = {
    "recipe": ("the recipe", {}),
    "gru": (
        "50 ms of samples and a gated recurrent unit instead of 0.7 s",
        {"task.observation": "dated", "memory": "gru"},
    ),
    "short-past": ("50 ms of samples instead of 0.7 s", {"task.observation": "dated"}),
    "three-samples": (
        "the paper's three samples, which do not tell their age",
        {"task.observation": "three-samples"},
    ),
    "small": ("two layers of 64 and 64", {"hidden": (64, 64)}),
    "no-help": ("a student that hops alone from the start", {"mixing_share": 1e-9}),
    "long-push": (
        "a teacher that lifts off with a longer leg, so pushes longer with less force",
        {"teacher.liftoff": 0.9, "teacher.liftoff_per_drop": 0.2, "teacher.least_push": 0.107},
    ),
    "no-calibration": ("the command as it is", {"calibrations": 0}),
}
"""By name: in words, and what is changed."""


@dataclass(frozen=True)
class Ablation:
    """Train `fast` with one part changed at a time."""

    variants: tuple[str, ...] = tuple(VARIANTS)
    """Names of those to train."""
    seeds: tuple[int, ...] = (0, 1, 2)
    """One training of every variant each."""
    steps: int = FAST.schedule.steps
    """Control steps of experience of each."""
    robot: RobotFile = DEFAULT_ROBOT
    out: Path = Path("runs/ablations")
    """Where results are kept: finished trainings are not repeated."""
    json: JsonFile = None

    def measure(self) -> Row:
        """Run it, print a table, return every number."""
        at_least(1, steps=self.steps)
        for name in self.variants:
            if name not in VARIANTS:
                raise UsageError(unknown_name("variant", name, VARIANTS))
        robot = load_robot(self.robot)
        usual = within_reach(FAST.replace(steps=self.steps).fit(robot), robot)
        rows = []
        for name in self.variants:
            meaning, changes = VARIANTS[name]
            recipe = usual.replace(changes)
            asked = {"recipe": repr(recipe), "robot": robot.digest}
            for seed in self.seeds:
                file = self.out / f"{name}-{seed}.json"
                found = once(file, asked, judged, recipe, robot, seed)
                rows.append({"variant": name, "meaning": meaning, "seed": seed, **found})
        lengths = ("mean_abs_median_error_m", "worst_abs_median_error_m", "mean_std_m")
        show_rows(rows, "variant", "seed", *lengths, "skipped_hops")
        return {
            "robot": self.robot,
            "steps": self.steps,
            "judging_seeds": JUDGING_SEEDS,
            "rows": rows,
            "variants": over_seeds(rows),
            "versions": software_versions(),
        }


def judged(recipe: Recipe, robot: Robot, seed: int) -> Row:
    """Train a policy and judge it."""
    torch.set_num_threads(1)
    learner, (low, high) = recipe.make_learner(robot, seed), recipe.task.command_bounds
    learner.train_until(recipe.schedule.steps, lambda: True, recipe.schedule.log_every)
    card = Card(
        recipe.name, recipe.task.observation, low, high, recipe.task.action_torque, robot.name,
        robot.digest, recipe.task.rate, seed,
    )  # fmt: skip
    seen = make_observation(robot, recipe.task, 1)
    content = build_policy(learner.network(), seen, card)
    rounds = recipe.selection.calibrations
    if rounds:
        content = calibrate(content, robot, rounds)
    return judge(content, robot)


def over_seeds(rows: list[Row]) -> list[Row]:
    """Return means over seeds, the worst of worst errors, and sums of faults."""
    ways: dict[str, Callable[[list[float]], float]] = {
        "mean_abs_median_error_m": lambda values: float(np.mean(values)),
        "mean_std_m": lambda values: float(np.mean(values)),
        "worst_abs_median_error_m": max,
        "skipped_hops": sum,
        "body_contact_ticks": sum,
    }
    found = []
    for name in dict.fromkeys(row["variant"] for row in rows):
        own = [row for row in rows if row["variant"] == name]
        about = {"variant": name, "meaning": own[0]["meaning"], "runs": len(own)}
        found.append(about | {key: of([row[key] for row in own]) for key, of in ways.items()})
    return found
