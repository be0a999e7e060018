"""What each part of `fast` is worth, and other ways to teach or to refine it.

Every variant is trained with several seeds for the same number of steps and judged on seeds that
chose nothing.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from rich.table import Table

from hopping_leg.cli.options import at_least
from hopping_leg.controllers.policy import Card
from hopping_leg.errors import UsageError, unknown_name
from hopping_leg.evaluate.result import ResultCache
from hopping_leg.evaluate.runner import software_versions
from hopping_leg.rl.onnx_export import Network, build_policy
from hopping_leg.rl.policy_evaluation import calibrate
from hopping_leg.rl.recipe import Recipe
from hopping_leg.rl.recipes.fast import FAST
from hopping_leg.rl.stages import within_reach
from hopping_leg.robot import DEFAULT_ROBOT, Robot, load_robot
from hopping_leg.terminal import plain_console
from studies.ablations import ppo
from studies.time_to_accuracy.run import JUDGING_SEEDS, judge

Row = dict[str, Any]
Train = Callable[[Recipe, Robot, int], Network]


def distilled(recipe: Recipe, robot: Robot, seed: int) -> Network:
    """Return the student of a distillation."""
    learner = recipe.make_learner(robot, seed)
    learner.train_until(recipe.schedule.steps, lambda: True, recipe.schedule.log_every)
    return learner.network()


def taught_by_ppo(recipe: Recipe, robot: Robot, seed: int) -> Network:
    """Return a student whose teacher has learnt by PPO for five times the student's steps."""
    make = ppo.learn_teacher(recipe, robot, seed, 5 * recipe.schedule.steps)
    learner: Any = recipe.make_learner(robot, seed)
    learner.teacher = make(learner.task)
    learner.train_until(recipe.schedule.steps, lambda: True, recipe.schedule.log_every)
    network: Network = learner.network()
    return network


def refined(recipe: Recipe, robot: Robot, seed: int) -> Network:
    """Return a student that goes on by PPO for half as many steps again."""
    learner: Any = recipe.make_learner(robot, seed)
    learner.train_until(recipe.schedule.steps, lambda: True, recipe.schedule.log_every)
    return ppo.refine(learner, recipe, robot, seed, recipe.schedule.steps // 2)


VARIANTS: dict[str, tuple[str, dict[str, Any], Train]] = {
    "recipe": ("the recipe", {}, distilled),
    "gru": (
        "50 ms of samples and a gated recurrent unit instead of 0.7 s",
        {"task.observation": "dated", "memory": "gru"},
        distilled,
    ),
    "short-past": (
        "50 ms of samples instead of 0.7 s",
        {"task.observation": "dated"},
        distilled,
    ),
    "three-samples": (
        "the paper's three samples, which do not tell their age",
        {"task.observation": "three-samples"},
        distilled,
    ),
    "small": ("two layers of 64 and 64", {"hidden": (64, 64)}, distilled),
    "no-help": ("a student that hops alone from the start", {"mixing_share": 1e-9}, distilled),
    "no-calibration": ("the command as it is", {"calibrations": 0}, distilled),
    "learnt-teacher": (
        "a teacher that has learnt by PPO, five times as long",
        {},
        taught_by_ppo,
    ),
    "refined": ("the recipe, then PPO for half as long again", {}, refined),
}
"""By name: in words, what is changed, and how it is trained."""


@dataclass(frozen=True)
class Ablation:
    """Train `fast` with one part changed at a time."""

    variants: tuple[str, ...] = tuple(VARIANTS)
    """Names of those to train."""
    seeds: tuple[int, ...] = (0, 1, 2)
    """One training of every variant each."""
    steps: int = 1_200_000
    """Control steps of experience of each."""
    robot: str = DEFAULT_ROBOT
    """A shipped name or the path of a .toml file."""
    out: Path = Path("runs/ablations")
    """Where results are kept: finished trainings are not repeated."""
    json: Path | None = None
    """Write every number to this file."""

    def measure(self) -> dict[str, Any]:
        """Run it, print a table, return every number."""
        at_least(1, steps=self.steps)
        for name in self.variants:
            if name not in VARIANTS:
                raise UsageError(unknown_name("variant", name, VARIANTS))
        console, robot = plain_console(), load_robot(self.robot)
        cache = ResultCache(self.out, console.print)
        usual, _ = within_reach(FAST.replace(steps=self.steps).fit(robot), robot)
        rows: list[Row] = []
        for name in self.variants:
            meaning, changes, train = VARIANTS[name]
            recipe = usual.replace(changes)
            for seed in self.seeds:
                found = cache.load_or_run(
                    f"{name}-{seed}",
                    f"{name}, seed {seed}",
                    {"recipe": repr(recipe), "robot": robot.digest},
                    lambda recipe=recipe, seed=seed, train=train: _judged(  # type: ignore[misc]
                        recipe, robot, seed, train
                    ),
                )
                rows.append({"variant": name, "meaning": meaning, "seed": seed, **found})
        table = Table("variant", "seed", "error, mm", "worst, mm", "std, mm", "skipped")
        for row in rows:
            keys = ("mean_abs_median_error_m", "worst_abs_median_error_m", "mean_std_m")
            cells = [f"{1e3 * row[key]:.1f}" for key in keys]
            table.add_row(row["variant"], str(row["seed"]), *cells, str(row["skipped_hops"]))
        console.print(table)
        return {
            "robot": self.robot,
            "steps": self.steps,
            "judging_seeds": JUDGING_SEEDS,
            "rows": rows,
            "variants": _over_seeds(rows),
            "versions": software_versions(),
        }


def _judged(recipe: Recipe, robot: Robot, seed: int, train: Train) -> Row:
    torch.set_num_threads(1)
    network = train(recipe, robot, seed)
    low, high = recipe.task.command_bounds
    card = Card(
        recipe.name, recipe.task.observation, low, high, recipe.task.action_torque, robot.name,
        robot.digest, recipe.task.rate, seed,
    )  # fmt: skip
    content = build_policy(network, card)
    rounds = recipe.selection.calibrations
    if rounds:
        content = calibrate(content, robot, (low, high), rounds, recipe.task.rate)
    return judge(content, robot)


def _over_seeds(rows: list[Row]) -> list[Row]:
    """Return means over seeds, the worst of worst errors, and sums of faults."""
    found = []
    for name in dict.fromkeys(row["variant"] for row in rows):
        own = [row for row in rows if row["variant"] == name]
        means = ("mean_abs_median_error_m", "mean_std_m")
        sums = ("skipped_hops", "body_contact_ticks")
        found.append(
            {
                "variant": name,
                "meaning": own[0]["meaning"],
                "runs": len(own),
                **{key: float(np.mean([row[key] for row in own])) for key in means},
                "worst_abs_median_error_m": max(row["worst_abs_median_error_m"] for row in own),
                **{key: sum(row[key] for row in own) for key in sums},
            }
        )
    return found
