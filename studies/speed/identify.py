"""How long a candidate, the paper's two passes and a short identification take."""

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from hopping_leg.cli.options import at_least
from hopping_leg.identify.pipeline import IdentifyOptions, identify
from hopping_leg.identify.plan import make_plan
from hopping_leg.identify.simulate import WindowSimulator
from hopping_leg.identify.windows import cut
from hopping_leg.robot import COARSE_TIMESTEP, load_robot
from hopping_leg.terminal import plain_console
from studies.identification.arm import draw_truth, record_arm
from studies.identification.twin import BELIEVED, record_paper
from studies.shared import host

_SHORT = 12.0
"""Of the short recording, s."""


@dataclass(frozen=True)
class Identify:
    """Time identification: a candidate, the paper's two passes, 12 s of an independent arm."""

    seconds: float = 240.0
    """Of each of the paper's two recordings."""
    repeats: int = 15
    """Rounds of the candidate; the fastest is reported, for one thread is easily held up."""
    threads: int = 2
    """Of the fits; the candidate has one."""
    json: Path | None = None
    """Write every number to this file."""

    def measure(self) -> dict[str, Any]:
        """Run it, print a table, return every number."""
        at_least(1, repeats=self.repeats, threads=self.threads)
        robot = load_robot(BELIEVED)
        recordings = record_paper(self.seconds)
        start = make_plan(recordings, robot).start
        windows = cut(recordings[:1])
        fixed = WindowSimulator(recordings[:1], windows, timestep=COARSE_TIMESTEP, threads=1)
        fixed.run([start])
        rounds = [_time(lambda: fixed.run([start])) for _ in range(self.repeats)]
        paper = IdentifyOptions(search="two-pass", threads=self.threads)
        arm = record_arm(robot, draw_truth(robot, np.random.default_rng(0)), _SHORT, 0)
        short = IdentifyOptions(threads=self.threads)
        result = {
            "recorded_s": 2 * self.seconds,
            "fixed_base_candidate_s": min(rounds),
            "two_pass_s": _time(lambda: identify(recordings, robot, options=paper)),
            "short_recorded_s": _SHORT,
            "short_identification_s": _time(lambda: identify([arm], robot, options=short)),
            "timestep_s": COARSE_TIMESTEP,
            "threads": self.threads,
            "host": host(),
        }
        table = Table("number", "value", title="Identification")
        for name, value in result.items():
            if isinstance(value, int | float):
                table.add_row(name, f"{value:.4g}")
        plain_console().print(table)
        return result


def _time(work: Any) -> float:  # noqa: ANN401
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin
