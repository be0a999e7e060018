"""Options of timing the environment."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from hopping_leg.cli.options import at_least
from hopping_leg.robot import load_robot
from hopping_leg.robot.model import TIMESTEP


@dataclass(frozen=True)
class Env:
    """Time the environment against bare physics and Gymnasium's LiveLeg-v5."""

    robot: str = "legv2-paper"
    """A shipped name or the path of a .toml file."""
    count: int = 512
    """Legs of the batched environment."""
    repeats: int = 15
    """Rounds; medians over them are reported."""
    threads: int = 0
    """Of the batched environment and the batched physics alike, 0 for one per core."""
    timestep: float = TIMESTEP
    """Physics step, s."""
    seed: int = 0
    """Of noise and delay."""
    json: Path | None = None
    """Write every number to this file."""

    def measure(self) -> dict[str, Any]:
        """Run it, print a table, return every number."""
        from studies.speed.env import EnvBenchmark, bench_env

        at_least(1, count=self.count, repeats=self.repeats)
        at_least(0, threads=self.threads, seed=self.seed)
        benchmark = EnvBenchmark(
            load_robot(self.robot),
            count=self.count,
            repeats=self.repeats,
            threads=self.threads,
            timestep=self.timestep,
            seed=self.seed,
        )
        with Progress(transient=True) as bar:
            task = bar.add_task("timing", total=self.repeats)
            result = bench_env(benchmark, lambda done, _: bar.update(task, completed=done))
        _print("Environment with noise and delay", result)
        return result


def _print(title: str, result: dict[str, Any]) -> None:
    table = Table("number", "value", title=title)
    for name, value in result.items():
        if isinstance(value, int | float):
            table.add_row(name, f"{value:,.4g}" if value < 100 else f"{value:,.0f}")
    Console().print(table)
