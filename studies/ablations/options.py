"""Options of the ablations."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from hopping_leg.cli.options import at_least, mm
from hopping_leg.robot import load_robot


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
        from studies.ablations.run import bench_ablation

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
