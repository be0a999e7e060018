"""Options of the study of training."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from hopping_leg.cli.options import at_least, mm
from hopping_leg.errors import UsageError
from hopping_leg.robot import load_robot


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
        from studies.training_time.run import bench_training

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
