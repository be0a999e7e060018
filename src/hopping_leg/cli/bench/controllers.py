"""Benchmarks of controllers and of training."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from hopping_leg.cli.bench.shared import at_least, mm
from hopping_leg.errors import UsageError
from hopping_leg.robot import load_robot


@dataclass(frozen=True)
class EnergyShaping:
    """Judge energy shaping: the printed law, the tuned one, what each part is worth."""

    runs: int = 6
    """Realisations of noise and delay per command."""
    duration: float = 12.0
    """Of a run, s; the first 2 s do not count."""
    seed: int = 0
    """Of noise and delay; no seed of the benchmark has tuned anything."""
    threads: int = 0
    """Threads of the physics, 0 for all cores; results do not depend on it."""
    json: Path | None = None
    """Write every number to this file."""

    def measure(self) -> dict[str, Any]:
        """Run it, print a table, return every number."""
        from hopping_leg.evaluate import bench_energy_shaping

        at_least(1, runs=self.runs)
        at_least(0, threads=self.threads, seed=self.seed)
        if not 4 <= self.duration <= 600:
            raise UsageError(f"--duration is {self.duration} s but must lie between 4 and 600 s.")
        with Progress(transient=True) as bar:
            task = bar.add_task("hopping", total=None)
            result = bench_energy_shaping.run(
                self.seed,
                runs=self.runs,
                seconds=self.duration,
                threads=self.threads,
                on_case=lambda done, total: bar.update(task, completed=done, total=total),
            )
        table = Table("case", "median error, mm", "std, mm", "hops/s", "skipped", "body contacts")
        for row in result["cases"]:
            sizes = [row["mean_abs_median_error_m"], row["mean_std_m"]]
            numbers = ["-" if x is None else f"{1e3 * x:.1f}" for x in sizes]
            numbers += [
                f"{row['hop_rate_hz']:.2f}",
                f"{row['skipped_hops']}",
                f"{row['body_contacts']}",
            ]
            table.add_row(row["case"], *numbers)
        Console().print(table)
        return result


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
    starts: int = 1
    """Trainings that begin side by side for every seed, as for ``hop train``."""
    out: Path = Path("runs/bench-training")
    """Where the trainings are kept; finished ones are not repeated, killed ones go on."""
    json: Path | None = None
    """Write every number to this file."""

    def measure(self) -> dict[str, Any]:
        """Run it, print a table, return every number."""
        from hopping_leg.evaluate.bench_training import bench_training
        from hopping_leg.rl.recipes import change, get_recipe

        at_least(1, evaluation_seeds=self.evaluation_seeds, threads=self.threads)
        at_least(1, starts=self.starts)
        if not self.training_seeds:
            raise UsageError("--training-seeds names no seed; give e.g. --training-seeds 0 1 2.")
        recipe = change(get_recipe(self.recipe), self.set)
        if self.steps is not None:
            recipe = replace(recipe, steps=self.steps)
        console = Console()
        result = bench_training(
            recipe,
            load_robot(self.robot),
            self.out,
            training_seeds=self.training_seeds,
            evaluation_seeds=self.evaluation_seeds,
            minutes=self.minutes,
            threads=self.threads,
            starts=self.starts,
            on_progress=console.print,
        )
        table = Table("minutes", "seed", "command, m", "median error, mm", "std, mm", "skipped")
        for row in result["rows"]:
            table.add_row(f"{row['minutes']:.1f}", *_hops(row))
        console.print(table)
        return result


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
        from hopping_leg.evaluate.bench_ablation import bench_ablation

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


def _hops(row: dict[str, Any]) -> list[str]:
    errors = [mm(row["median_error_m"]), mm(row["std_m"])]
    return [str(row["seed"]), f"{row['command_m']:.2f}", *errors, str(row["skipped_hops"])]
