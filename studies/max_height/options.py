"""Options of the search for the highest hops."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from hopping_leg.cli.options import at_least
from hopping_leg.errors import UsageError
from hopping_leg.robot import load_robot
from hopping_leg.robot.parameters import JOINTS


@dataclass(frozen=True)
class Reach:
    """Search for the highest lasting hops within torques, with the true state and no noise."""

    robot: str = "legv2-paper"
    """A shipped name or the path of a .toml file."""
    torques: tuple[tuple[float, float], ...] = ((6, 6), (6, 12), (10, 20))
    """Limits of hip and knee, N m at the joints: what the policies may ask for, the rated torque
    of the qdd100 behind its belt, and the motors' limit in the robot file of leg V2."""
    generations: int = 100
    """Of CMA-ES, for each pair."""
    population: int = 32
    """Candidates per generation."""
    seed: int = 0
    """Of the search."""
    threads: int = 0
    """Threads of the physics, 0 for all cores; results do not depend on it."""
    folder: Path = Path("runs/bench-reach")
    """Where what was found for a pair is kept; it is not searched again."""
    json: Path | None = None
    """Write every number to this file."""

    def measure(self) -> dict[str, Any]:
        """Run it, print a table, return every number."""
        from hopping_leg.evaluate.result_cache import ResultCache
        from studies.max_height.run import ReachStudy, measure_reach

        at_least(1, generations=self.generations)
        at_least(4, population=self.population)
        at_least(0, threads=self.threads, seed=self.seed)
        if not self.torques or not all(t > 0 for pair in self.torques for t in pair):
            raise UsageError("--torques must be pairs of positive torques, N m; e.g. 6 6 10 20.")
        study = ReachStudy(
            load_robot(self.robot),
            self.torques,
            generations=self.generations,
            population=self.population,
            seed=self.seed,
            threads=self.threads,
        )
        with Progress(transient=True) as bar:
            task = bar.add_task("searching", total=None)
            result = measure_reach(
                study,
                ResultCache(self.folder),
                lambda done, total: bar.update(task, completed=done, total=total),
            )
        table = Table("hip, N m", "knee, N m", "apex, m", "hops/s", "rms hip", "rms knee", "hits")
        for row in result["rows"]:
            limits = [f"{row[f'{joint}_limit_nm']:g}" for joint in JOINTS]
            names = ("apex_m", "hop_rate_hz", "rms_hip_torque_nm", "rms_knee_torque_nm")
            cells = [f"{row[name]:.3g}" for name in names]
            table.add_row(*limits, *cells, str(row["body_contacts"]))
        Console().print(table)
        return result
