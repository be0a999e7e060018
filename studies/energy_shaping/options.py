"""Options of the study of energy shaping."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from hopping_leg.cli.options import at_least
from hopping_leg.errors import UsageError


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
        from studies.energy_shaping import run as bench_energy_shaping

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
