"""The fault campaign."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from hopping_leg.cli.options import at_least


@dataclass(frozen=True)
class Faults:
    """Let everything go wrong that can, at random moments of the hop cycle; count what is unsafe.

    Trials run in virtual time behind the emulated wire and are exact; some run in real time, too,
    and measure how soon the host reacts, fairly on an idle computer only. Interrupted, it goes on.
    """

    repeats: int = 100
    """Random moments of each family, for each controller."""
    live: int | None = None
    """Of them in real time, of the families that show in an answer; default: every tenth."""
    seed: int = 0
    """Of moments, values and drives."""
    controllers: tuple[str, ...] = ("fast", "energy-shaping")
    """Shipped names or files."""
    robot: str = "legv2-paper"
    """The leg behind the wire: a shipped name or the path of a .toml file."""
    families: tuple[str, ...] = ()
    """Families of faults; default: all."""
    workers: int = 0
    """Processes, 0 for one per core; results do not depend on it."""
    out: Path = Path("runs/bench-faults")
    """Where finished trials are kept; they are not repeated."""
    json: Path | None = None
    """Write every number to this file."""

    def measure(self) -> dict[str, Any]:
        """Run it, print a table, return every number."""
        from studies.fault_campaign.campaign import Campaign, run_campaign
        from studies.fault_campaign.families import FAMILIES

        at_least(1, repeats=self.repeats)
        at_least(0, seed=self.seed, workers=self.workers, live=self.live or 0)
        campaign = Campaign(
            controllers=self.controllers,
            robot=self.robot,
            families=self.families or tuple(FAMILIES),
            repeats=self.repeats,
            live=math.ceil(self.repeats / 10) if self.live is None else self.live,
            seed=self.seed,
        )
        with Progress(console=Console(stderr=True)) as bar:
            task = bar.add_task("trials", total=None)
            result = run_campaign(
                campaign,
                self.out,
                workers=self.workers,
                on_trial=lambda done, total, unsafe: bar.update(
                    task, completed=done, total=total, description=f"trials, {unsafe} unsafe"
                ),
            )
        _print(result)
        return result


def _print(result: dict[str, Any]) -> None:
    table = Table("family", "trials", "unsafe", "ended for", "reaction 99 %, ms")
    for row in result["rows"]:
        reasons = ", ".join(f"{name.lower()} {n}" for name, n in row["reasons"].items())
        table.add_row(
            row["family"],
            str(row["trials"]),
            str(row["unsafe"]),
            reasons,
            _ms(row["reaction_p99_s"]),
        )
    console = Console()
    console.print(table)
    console.print(
        f"{result['trials']} trials, {result['unsafe']} unsafe. Bad answer to safe command:"
        f" {_ms(result['reaction_p99_s'])} ms at 99 %. Host's death to brake:"
        f" {_ms(result['host_death_to_brake_max_s'])} ms at most."
    )
    if result["disturbed_trials"]:
        console.print(
            f"{result['disturbed_trials']} of {result['live_trials']} trials in real time ended"
            " safely before their time as the computer was too busy; they tell nothing."
        )
    for row in result["unsafe_trials"]:
        console.print(f"{row['family']}, {row['controller']}, {row['what']}: {row['problems'][0]}")


def _ms(seconds: float | None) -> str:
    return "-" if seconds is None else f"{seconds * 1e3:.1f}"
