"""What each part of a recipe is worth: the recipe with one part taken away at a time."""

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from hopping_leg.cli.options import at_least, mm
from hopping_leg.errors import UsageError, unknown_name
from hopping_leg.evaluate.runner import software_versions
from hopping_leg.rl.recipes import VARIANTS
from hopping_leg.robot import Robot, load_robot
from studies.training_time.run import bench_training, over_commands

_OF_A_RUN = ("seed", "minutes", "teacher_scores_m")
_COUNTED = ("skipped_hops", "body_contacts")


def bench_ablation(
    recipe: str,
    robot: Robot,
    out: Path,
    *,
    steps: int,
    variants: Sequence[str] = (),
    training_seeds: Sequence[int] = (0,),
    evaluation_seeds: int = 5,
    threads: int = 2,
    on_progress: Callable[[str], None] = lambda _note: None,
) -> dict[str, Any]:
    """Train variants for the same number of steps and judge them.

    Args:
        recipe: Name of the recipe.
        robot: The leg.
        out: Folder of the runs.
        steps: Control steps of experience of each.
        variants: Names of those to train, in any order; all if there are none.
        training_seeds: Of the trainings.
        evaluation_seeds: Realisations of noise and delay per command.
        threads: Of torch and physics.
        on_progress: Called with a sentence on what begins.

    Raises:
        UsageError: There are no ablations of the recipe, or none of a name.
    """
    if recipe not in VARIANTS:
        raise UsageError(unknown_name("recipe with ablations", recipe, VARIANTS))
    known = VARIANTS[recipe]
    for name in variants:
        if name not in known:
            raise UsageError(unknown_name(f"variant of {recipe}", name, known))
    rows: list[dict[str, Any]] = []
    found: list[dict[str, Any]] = []
    for name in [name for name in known if not variants or name in variants]:
        meaning, variant = known[name]
        result = bench_training(
            variant.replace(steps=steps, eval_every=max(1, steps // 5)),
            robot,
            out / name,
            training_seeds=training_seeds,
            evaluation_seeds=evaluation_seeds,
            threads=threads,
            on_progress=functools.partial(_named, on_progress, name),
        )
        named = {"variant": name, "meaning": meaning}
        rows += [{**named, **row} for row in result["rows"]]
        found += [
            {
                **named,
                **{key: run[key] for key in _OF_A_RUN},
                **over_commands(run["selected"]),
                **{key: sum(row[key] for row in run["selected"]) for key in _COUNTED},
            }
            for run in result["runs"]
        ]
    return {
        "recipe": recipe,
        "robot": robot.name,
        "steps": steps,
        "threads": threads,
        "evaluation_seeds": evaluation_seeds,
        "rows": rows,
        "variants": found,
        "versions": software_versions(),
    }


def _named(on_progress: Callable[[str], None], name: str, note: str) -> None:
    on_progress(f"{name}: {note}")


@dataclass(frozen=True)
class Ablation:
    """Train a recipe with one part taken away at a time."""

    recipe: str = "fast"
    """`fast` or `precise`."""
    steps: int = 2_000_000
    """Control steps of experience of each variant."""
    variants: tuple[str, ...] = ()
    """Names of those to train; all, unless some are named."""
    robot: str = "legv2-paper"
    """A shipped name or the path of a .toml file."""
    training_seeds: tuple[int, ...] = (0,)
    """One training of every variant each."""
    evaluation_seeds: int = 5
    """Realisations of noise and delay per command."""
    threads: int = 2
    """Of torch and physics."""
    out: Path = Path("runs/bench-ablation")
    """Where the trainings are kept; finished ones are not repeated, killed ones go on."""
    json: Path | None = None
    """Write every number to this file."""

    def measure(self) -> dict[str, Any]:
        """Run it, print a table, return every number."""
        at_least(1, steps=self.steps, evaluation_seeds=self.evaluation_seeds, threads=self.threads)
        console = Console()
        result = bench_ablation(
            self.recipe,
            load_robot(self.robot),
            self.out,
            steps=self.steps,
            variants=self.variants,
            training_seeds=self.training_seeds,
            evaluation_seeds=self.evaluation_seeds,
            threads=self.threads,
            on_progress=console.print,
        )
        table = Table(
            "variant", "seed", "mean error, mm", "worst, mm", "std, mm", "skipped", "contacts"
        )
        for row in result["variants"]:
            names = ("mean_abs_median_error_m", "worst_abs_median_error_m", "std_m")
            numbers = [mm(row[name]) for name in names]
            counts = [str(row[name]) for name in ("skipped_hops", "body_contacts")]
            table.add_row(row["meaning"], str(row["seed"]), *numbers, *counts)
        console.print(table)
        return result
