"""Search the gains of energy shaping with CMA-ES and write them as a gain file.

All candidates hop at once, each at five heights and from three first gains, with the paper's noise
and delay. An interrupted search goes on where it was: call it again with the same options.

Examples:
  hop tune energy-shaping
  hop tune energy-shaping --robot my_leg.toml --out runs/my_leg
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from hopping_leg.cli.output import write_json
from hopping_leg.errors import UsageError
from hopping_leg.evaluate.tune_energy_shaping import Search, Tuned, tune
from hopping_leg.robot import load_robot

CONTROLLERS = ("energy-shaping",)


@dataclass(frozen=True)
class TuneArgs:
    """What to search, and how long."""

    controller: tyro.conf.Positional[str] = "energy-shaping"
    """What is tuned; only energy-shaping has gains."""
    robot: str = "legv2-paper"
    """A shipped name or the path of a .toml file."""
    start: str = "by-hand"
    """Gains to begin from: by-hand, energy-shaping (the shipped result) or a gain file's path."""
    search: Annotated[Search, tyro.conf.arg(name="")] = field(default_factory=Search)
    seed: int = 0
    """Of the search; noise and delay take seeds 0 to 9."""
    out: Path = Path("runs/tune")
    """Folder for the log and the gains."""
    json: Path | None = None
    """Write every number to this file."""


def run(args: TuneArgs) -> None:
    """Search, print what came out, write the gains."""
    if args.controller not in CONTROLLERS:
        raise UsageError(
            f"Controller '{args.controller}' has no gains to tune; valid: {', '.join(CONTROLLERS)}."
        )
    robot = load_robot(args.robot)
    with Progress() as progress:
        task = progress.add_task("searching", total=args.search.generations)

        def report(done: int, lowest: float) -> None:
            progress.update(task, completed=done, description=f"lowest cost {lowest:.2f} mm")

        tuned = tune(robot, args.robot, args.start, args.search, args.seed, args.out, report)
    Console().print(_table(tuned))
    Console().print(
        f"Gains: {args.out / 'gains.toml'}; use: hop evaluate {args.out / 'gains.toml'}"
    )
    if args.json is not None:
        write_json(args.json, tuned.record())


def _table(tuned: Tuned) -> Table:
    table = Table("command, m", "median before", "after", "std before, mm", "after")
    for before, after in zip(tuned.before, tuned.after, strict=True):
        numbers: list[Any] = [
            f"{before.command:.2f}",
            f"{before.median:.4f}",
            f"{after.median:.4f}",
        ]
        numbers += [f"{1e3 * before.std:.1f}", f"{1e3 * after.std:.1f}"]
        table.add_row(*numbers)
    return table
