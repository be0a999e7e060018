"""Benchmark of what limits accuracy."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from hopping_leg.cli.options import Heights, at_least, mm
from hopping_leg.robot import load_robot

_SHOWN = ("worst_abs_median_error_m", "mean_std_m", "worst_std_m")


@dataclass(frozen=True)
class Limits:
    """Take noise, delay and soft ground away in turn, and give a controller the true state."""

    controllers: tuple[str, ...] = ("precise", "adaptive", "recurrent", "energy-shaping")
    """Names or .onnx files."""
    teacher: Path | None = None
    """Folder of a run of `precise`: its teacher, which is shown the true state, joins them."""
    robot: str = "legv2-paper"
    """A shipped name or the path of a .toml file."""
    commands: Heights = (0.22, 0.25, 0.28, 0.31, 0.34, 0.37, 0.40)
    """Apex heights, m."""
    seeds: int = 5
    """Realisations of noise and delay per command."""
    seed: int = 1000
    """All of them follow from it; choose one that selected nothing."""
    threads: int = 0
    """Threads of the physics, 0 for all cores; results do not depend on it."""
    folder: Path = Path("runs/bench-limits")
    """Where each result is kept; what is there is not done again."""
    json: Path | None = None
    """Write every number to this file."""

    def measure(self) -> dict[str, Any]:
        """Run it, print a table, return every number."""
        from hopping_leg.evaluate.entries import Entry, load_entries
        from hopping_leg.evaluate.result_cache import ResultCache
        from hopping_leg.sim import CONTROL_RATE
        from studies.limits.run import LimitsStudy, measure_limits

        at_least(1, seeds=self.seeds)
        at_least(0, threads=self.threads, seed=self.seed)
        robot = load_robot(self.robot)
        entries = load_entries(self.controllers, robot, CONTROL_RATE)
        if self.teacher is not None:
            from studies.limits.teacher_of_run import teacher_of_run

            teacher = teacher_of_run(self.teacher, robot)
            entries.append(Entry(teacher.name, teacher, teacher.command_range))
        study = LimitsStudy(
            robot, self.commands, seeds=self.seeds, seed=self.seed, threads=self.threads
        )
        with Progress(transient=True) as bar:
            task = bar.add_task("hopping", total=None)
            result = measure_limits(
                entries,
                study,
                ResultCache(self.folder, lambda words: bar.update(task, description=words)),
                lambda done, total: bar.update(task, completed=done, total=total),
            )
        table = Table("controller", "with", "worst |error|, mm", "mean std, mm", "worst", "skipped")
        for row in result["rows"]:
            numbers = [mm(row[name]) for name in _SHOWN]
            table.add_row(row["controller"], row["condition"], *numbers, str(row["skipped_hops"]))
        Console().print(table)
        return result
