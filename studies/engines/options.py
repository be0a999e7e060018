"""Benchmark of the physics engines."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from hopping_leg.cli.options import Heights, at_least, mm
from hopping_leg.robot import load_robot
from hopping_leg.robot.model import TIMESTEP


@dataclass(frozen=True)
class Engines:
    """Let controllers hop in PyBullet as well, without retraining; needs the extra `bullet`."""

    controllers: tuple[str, ...] = (
        "energy-shaping",
        "fast",
        "precise",
        "adaptive",
        "recurrent",
        "paper",
    )
    """Names or .onnx files."""
    robot: str = "legv2-paper"
    """A shipped name or the path of a .toml file."""
    commands: Heights | None = None
    """Apex heights, m; default 0.25,0.30,0.35, scaled to the leg's length."""
    seeds: int = 2
    """Realisations of noise and delay per command."""
    seed: int = 1000
    """All of them follow from it; choose one that selected nothing."""
    timestep: float = TIMESTEP
    """Physics step, s."""
    workers: int = 2
    """Processes that share the work; the numbers do not depend on it."""
    json: Path | None = None
    """Write every number to this file."""

    def measure(self) -> dict[str, Any]:
        """Run it, print a table, return every number."""
        from studies.engines.run import EnginesStudy, bench_engines

        at_least(1, seeds=self.seeds, workers=self.workers)
        at_least(0, seed=self.seed)
        study = EnginesStudy(
            load_robot(self.robot),
            controllers=self.controllers,
            commands=self.commands,
            seeds=self.seeds,
            seed=self.seed,
            timestep=self.timestep,
        )
        with Progress(transient=True) as bar:
            task = bar.add_task("hopping", total=None)
            result = bench_engines(
                study,
                self.workers,
                lambda done, total: bar.update(task, completed=done, total=total),
            )
        _print(result)
        return result


def _print(result: dict[str, Any]) -> None:
    table = Table(
        "world", "controller", "largest median error, mm", "std, mm", "skipped", "in order"
    )
    for row in result["worlds"]:
        table.add_row(
            row["world"],
            row["controller"],
            mm(row["largest_median_error_m"]),
            mm(row["mean_std_m"]),
            str(row["skipped_hops"]),
            "yes" if row["ordered"] else "no",
        )
    Console().print(table)
