"""How long a candidate, the paper's two passes and a short identification take."""

from dataclasses import dataclass

import numpy as np

from hopping_leg.cli.options import JsonFile, at_least
from hopping_leg.identify.pipeline import IdentifyOptions, identify
from hopping_leg.identify.plan import make_plan
from hopping_leg.identify.simulate import WindowSimulator
from hopping_leg.identify.windows import cut
from hopping_leg.robot import COARSE_TIMESTEP, load_robot
from studies.identification.arm import draw_truth, record_arm
from studies.identification.twin import BELIEVED, record_paper
from studies.shared import Row, host, seconds, show_numbers

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
    json: JsonFile = None

    def measure(self) -> Row:
        """Run it, print and return every number."""
        at_least(1, repeats=self.repeats, threads=self.threads)
        robot, recordings = load_robot(BELIEVED), record_paper(self.seconds)
        start, fixed = make_plan(recordings, robot).start, recordings[:1]
        simulator = WindowSimulator(fixed, cut(fixed), timestep=COARSE_TIMESTEP, threads=1)
        simulator.run([start])
        paper = IdentifyOptions(search="two-pass", threads=self.threads)
        arm = record_arm(robot, draw_truth(robot, np.random.default_rng(0)), _SHORT, 0)
        short = IdentifyOptions(threads=self.threads)
        result = {
            "recorded_s": 2 * self.seconds,
            "fixed_base_candidate_s": min(
                seconds(lambda: simulator.run([start])) for _ in range(self.repeats)
            ),
            "two_pass_s": seconds(lambda: identify(recordings, robot, options=paper)),
            "short_recorded_s": _SHORT,
            "short_identification_s": seconds(lambda: identify([arm], robot, options=short)),
            "timestep_s": COARSE_TIMESTEP,
            "threads": self.threads,
            "host": host(),
        }
        show_numbers("Identification", result)
        return result
