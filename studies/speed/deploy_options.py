"""Benchmark of the control loop on emulated drives."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from hopping_leg.cli.options import mm
from hopping_leg.errors import UsageError


@dataclass(frozen=True)
class Deploy:
    """Run a controller against emulated drives: ticks and wake-ups in real time, hop heights."""

    controller: str = "fast"
    """A name, an .onnx file or a gain file."""
    robot: str = "legv2-paper"
    """A shipped name or the path of a .toml file."""
    minutes: float = 10.0
    """Of hopping in real time, through all heights in turn."""
    seconds: float = 15.0
    """Of hopping at each height where heights are compared."""
    json: Path | None = None
    """Write every number to this file."""

    def measure(self) -> dict[str, Any]:
        """Run it, print a table, return every number."""
        from studies.speed.deploy import Study, bench_deploy

        for name, value, least in (("minutes", self.minutes, 0.05), ("seconds", self.seconds, 3.0)):
            if not least <= value <= 600:
                raise UsageError(f"--{name} is {value:g} but must lie between {least:g} and 600.")
        console = Console()
        study = Study(self.controller, self.robot, self.minutes, self.seconds)
        result = bench_deploy(study, lambda words: console.print(f"{words} ..."))
        _print(console, result)
        return result


def _print(console: Console, result: dict[str, Any]) -> None:
    names = ("wake_late_us", "exchange_us", "control_us", "tick_us")
    table = Table("us", *result["tick_us"])
    for name in names:
        cells = [f"{value:.0f}" for value in result[name].values()]
        table.add_row(name.removesuffix("_us").replace("_", " "), *cells)
    console.print(table)
    console.print(
        f"{100 * result['share_on_time']:.3f} % of {result['ticks'] + result['skipped']} ticks on"
        f" time in {result['minutes']:.1f} minutes; stops: {len(result['stops'])}."
    )
    for sentence in (*result["stops"], *result["notices"]):
        console.print(f"- {sentence}", soft_wrap=True)
    heights = Table("command, mm", "in process", "through the wire", "in real time")
    rows = zip(result["heights"], result["real_time_heights"], strict=True)
    for row, live in rows:
        values = (row["in_process_m"], row["through_the_wire_m"], live["apex_m"])
        heights.add_row(mm(row["command_m"]), *map(mm, values))
    console.print(heights)
