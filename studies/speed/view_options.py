"""Benchmark of the viewer."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro
from rich.console import Console
from rich.table import Table

from hopping_leg.cli.options import at_least
from hopping_leg.errors import UsageError


@dataclass(frozen=True)
class View:
    """Drive the viewer's page in a Chromium without a screen; needs extra `view`, playwright."""

    controllers: Annotated[tuple[str, ...], tyro.conf.Positional] = ("fast",)
    """One, or two side by side: names, .onnx or gain files."""
    robot: str = "legv2-paper"
    """A shipped name or the path of a .toml file."""
    seconds: float = 20.0
    """Of watching."""
    commands: int = 40
    """Changes of the height by the slider."""
    picture: Path | None = None
    """Write a picture of the page to this file (.png)."""
    json: Path | None = None
    """Write every number to this file."""

    def measure(self) -> dict[str, Any]:
        """Run it, print a table, return every number."""
        from studies.speed.view import ViewBenchmark, bench_view

        at_least(1, commands=self.commands)
        if not 1 <= self.seconds <= 600:
            raise UsageError(f"--seconds is {self.seconds:g} but must lie between 1 and 600.")
        console = Console()
        benchmark = ViewBenchmark(
            self.controllers, self.robot, self.seconds, self.commands, self.picture
        )
        result = bench_view(benchmark, lambda words: console.print(f"{words} ..."))
        table = Table("measured", "value")
        for watched in (result, result["small_window"]):
            width, height = watched["window"]
            table.add_row(
                f"frames per second, window of {width} x {height}",
                f"{watched['frames_per_s']:.1f}",
            )
        table.add_row("poses sent per second", f"{result['pictures_sent_per_s']:.1f}")
        table.add_row("simulated over real time", f"{result['real_time']:.3f}")
        latency = result["latency_ms"]
        table.add_row("slider to command, median, ms", f"{latency['median']:.0f}")
        table.add_row("slider to command, longest, ms", f"{latency['most']:.0f}")
        table.add_row("from the command to the first hop, s", f"{result['start_s']:.1f}")
        console.print(table)
        return result
