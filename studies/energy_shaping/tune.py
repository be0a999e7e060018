"""Search the gains of energy shaping with CMA-ES; writes a gain file.

All candidates hop at once, each at the given heights and from three first gains, with the paper's
noise and delay. An interrupted search goes on where it was: call it again with the same options.
"""

import sys
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import tyro

from hopping_leg.cli.options import JsonFile, RobotFile, say, say_next, show_table
from hopping_leg.errors import UsageError
from hopping_leg.locks import hold_folder
from hopping_leg.progress import LiveProgress
from hopping_leg.robot import DEFAULT_ROBOT, load_robot
from studies.energy_shaping.tuning import Search, tune
from studies.shared import main


class SearchProgress(LiveProgress):
    """Generations done of a search for gains, and the lowest cost, as a context manager."""

    def update(self, generations: int, done: int, lowest: float) -> None:
        """Show how many of all generations are done, and the lowest cost, mm."""
        self._show("search", "searching", done / generations, f"lowest cost {lowest:.2f} mm")


@dataclass(frozen=True)
class GainSearch:
    """Search the gains of energy shaping with CMA-ES."""

    robot: RobotFile = DEFAULT_ROBOT
    start: str = "by-hand"
    """Gains to begin from: by-hand, energy-shaping (the shipped result) or a gain file's path."""
    search: Annotated[Search, tyro.conf.arg(name="")] = field(default_factory=Search)
    seed: int = 0
    """Seed of the search; noise and delay take seeds 0 to 9."""
    out: Path = Path("runs/tune")
    """Folder for the log and the gains."""
    json: JsonFile = None

    def measure(self) -> dict[str, Any]:
        """Search, print what came out, write the gains; return scores and gains."""
        robot = load_robot(self.robot)
        with hold_folder(self.out, UsageError), SearchProgress("searching") as progress:
            report = partial(progress.update, self.search.generations)
            tuned = tune(robot, self.robot, self.start, self.search, self.seed, self.out, report)
        show_table(
            ("command, m", "median before", "after", "std before, mm", "after"),
            [
                (
                    f"{before['command']:.2f}",
                    *(f"{score['median']:.4f}" for score in (before, after)),
                    *(f"{1e3 * score['std']:.1f}" for score in (before, after)),
                )
                for before, after in zip(tuned["before"], tuned["after"], strict=True)
            ],
        )
        gains = self.out / "gains.toml"
        say(f"Gains: {gains}")
        say_next(["hop", "evaluate", gains, "--robot", self.robot])
        return tuned


if __name__ == "__main__":
    sys.exit(main("energy_shaping.tune", GainSearch))
