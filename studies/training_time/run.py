"""From scratch to accurate hopping: how long a recipe takes, over training seeds.

Training chooses its snapshots on its own seeds; every snapshot is judged here once more on seeds
that chose nothing, so that the curve is what a user gets who stops early.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from hopping_leg.cli.options import at_least, mm
from hopping_leg.controllers import RolloutConfig
from hopping_leg.controllers.policy import Policy
from hopping_leg.errors import UsageError
from hopping_leg.evaluate.entries import Entry
from hopping_leg.evaluate.runner import evaluate, software_versions
from hopping_leg.rl.parallel_seeds import ParallelSeeds
from hopping_leg.rl.recipe import Recipe
from hopping_leg.rl.run_folder import read_result
from hopping_leg.robot import Robot, load_robot

JUDGING_SEED = 1000
"""First of the evaluation seeds."""

_OF_SEEDS = ("seed_scores", "chosen_seed")


def bench_training(
    recipe: Recipe,
    robot: Robot,
    out: Path,
    *,
    training_seeds: Sequence[int] = (0, 1, 2),
    evaluation_seeds: int = 5,
    minutes: float | None = None,
    threads: int = 2,
    parallel_seeds: int = 1,
    on_progress: Callable[[str], None] = lambda _note: None,
) -> dict[str, Any]:
    """Train from scratch with several seeds and judge every snapshot and every selected policy.

    A run that is already complete in ``out`` is not trained again; one that was killed goes on.

    Args:
        recipe: What to train.
        robot: The leg.
        out: Folder of the runs, one per training seed.
        training_seeds: Of the trainings.
        evaluation_seeds: Realisations of noise and delay per command.
        minutes: Of learning, by the clock; None learns until the recipe's steps are done.
        threads: Of torch and physics, of each training.
        parallel_seeds: Trainings side by side, of which the best policy counts.
        on_progress: Called with a sentence on what begins.

    Returns:
        Per training seed: minutes, selection included, how its teachers scored, its
        parallel seeds if there were several, the selected policy's summary rows, and the curve of
        (minutes, worst and mean |median error| over commands) of all snapshots.
    """
    runs = []
    for seed in training_seeds:
        folder = out / f"{recipe.name}-seed{seed}"
        on_progress(f"training {recipe.name} with seed {seed}")
        several = ParallelSeeds(recipe, robot, seed, folder, parallel_seeds, minutes, threads)
        if not (folder / "policy.onnx").exists():
            several.train(resume=folder.exists())
        on_progress(f"judging {recipe.name} with seed {seed}")
        result = read_result(folder)
        content = (folder / "policy.onnx").read_bytes()
        learnt = several.folder(result.get("chosen_seed", 0))
        runs.append(
            {
                "seed": seed,
                "minutes": result["minutes"],
                "steps": result["steps"],
                "teacher_scores_m": result.get("teacher_scores_m", []),
                **{key: result[key] for key in _OF_SEEDS if key in result},
                "selected": _judge({"selected": content}, recipe, robot, evaluation_seeds),
                "curve": _curve(learnt, recipe, robot, evaluation_seeds),
            }
        )
    return {
        "recipe": recipe.name,
        "robot": robot.name,
        "threads": threads,
        "parallel_seeds": parallel_seeds,
        "minutes_budget": minutes,
        "evaluation_seed": JUDGING_SEED,
        "evaluation_seeds": evaluation_seeds,
        "runs": runs,
        "rows": [
            {"seed": run["seed"], "minutes": run["minutes"], **row}
            for run in runs
            for row in run["selected"]
        ],
        "curve": [{"seed": run["seed"], **point} for run in runs for point in run["curve"]],
        "minutes_max": max(run["minutes"] for run in runs),
        "worst_abs_median_error_m": over_commands([row for run in runs for row in run["selected"]])[
            "worst_abs_median_error_m"
        ],
        "versions": software_versions(),
    }


def _curve(
    folder: Path, recipe: Recipe, robot: Robot, evaluation_seeds: int
) -> list[dict[str, Any]]:
    """Judge every snapshot of a training."""
    result = read_result(folder)
    snapshots = {f.stem: f.read_bytes() for f in sorted((folder / "snapshots").glob("*.onnx"))}
    rows = _judge(snapshots, recipe, robot, evaluation_seeds)
    times = {f"{row['steps']:012d}": row["minutes"] for row in result["history"]}
    return [
        {
            "steps": int(name),
            "minutes": times[name],
            **over_commands([row for row in rows if row["controller"] == name]),
        }
        for name in snapshots
    ]


def _judge(
    policies: dict[str, bytes], recipe: Recipe, robot: Robot, seeds: int
) -> list[dict[str, Any]]:
    """Judge policies at the heights of the recipe's own trials."""
    entries = []
    for label, content in policies.items():
        policy = Policy(content, label, label)
        bounds = (policy.card.command_low, policy.card.command_high)
        entries.append(Entry(label, policy, bounds))
    judged = evaluate(
        entries,
        RolloutConfig(robot),
        commands=recipe.selection.eval_commands,
        repeats=seeds,
        seed=JUDGING_SEED,
        kinds=("fixed",),
    )
    rows: list[dict[str, Any]] = judged.evaluation.to_json()["summary"]
    return rows


def over_commands(rows: list[dict[str, Any]]) -> dict[str, float | None]:
    """Return how far off a policy's hops are over the commands, m.

    Args:
        rows: Its summary, a row per command.

    Returns:
        Worst and mean |median error|, and the mean scatter; null where it does not hop at some
        command.
    """
    errors = [row["median_error_m"] for row in rows]
    if any(error is None for error in errors):
        return {"worst_abs_median_error_m": None, "mean_abs_median_error_m": None, "std_m": None}
    return {
        "worst_abs_median_error_m": float(np.max(np.abs(errors))),
        "mean_abs_median_error_m": float(np.mean(np.abs(errors))),
        "std_m": float(np.mean([row["std_m"] for row in rows])),
    }


@dataclass(frozen=True)
class Training:
    """Train a recipe from scratch with several seeds; judge every snapshot on other seeds."""

    recipe: str = "fast"
    """As for ``hop train``."""
    robot: str = "legv2-paper"
    """A shipped name or the path of a .toml file."""
    training_seeds: tuple[int, ...] = (0, 1, 2)
    """One training each."""
    evaluation_seeds: int = 5
    """Realisations of noise and delay per command."""
    steps: int | None = None
    """Control steps of experience instead of the recipe's."""
    set: tuple[str, ...] = ()
    """Numbers of the recipe to change, as for ``hop train``."""
    minutes: float | None = None
    """Of learning, by the clock, after which the best snapshot is selected."""
    threads: int = 2
    """Of torch and physics, of each start."""
    parallel_seeds: int = 1
    """Trainings that begin side by side for every seed, as for ``hop train``."""
    out: Path = Path("runs/bench-training")
    """Where the trainings are kept; finished ones are not repeated, killed ones go on."""
    json: Path | None = None
    """Write every number to this file."""

    def measure(self) -> dict[str, Any]:
        """Run it, print a table, return every number."""
        from hopping_leg.rl.recipes import change, get_recipe

        at_least(1, evaluation_seeds=self.evaluation_seeds, threads=self.threads)
        at_least(1, parallel_seeds=self.parallel_seeds)
        if not self.training_seeds:
            raise UsageError("--training-seeds names no seed; give e.g. --training-seeds 0 1 2.")
        recipe = change(get_recipe(self.recipe), self.set)
        if self.steps is not None:
            recipe = recipe.replace(steps=self.steps)
        console = Console()
        result = bench_training(
            recipe,
            load_robot(self.robot),
            self.out,
            training_seeds=self.training_seeds,
            evaluation_seeds=self.evaluation_seeds,
            minutes=self.minutes,
            threads=self.threads,
            parallel_seeds=self.parallel_seeds,
            on_progress=console.print,
        )
        table = Table("minutes", "seed", "command, m", "median error, mm", "std, mm", "skipped")
        for row in result["rows"]:
            table.add_row(f"{row['minutes']:.1f}", *_hops(row))
        console.print(table)
        return result


def _hops(row: dict[str, Any]) -> list[str]:
    errors = [mm(row["median_error_m"]), mm(row["std_m"])]
    return [str(row["seed"]), f"{row['command_m']:.2f}", *errors, str(row["skipped_hops"])]
