"""What a method's simulation foretells of a policy that was trained on none of the twins.

One shipped policy hops in the simulation and on the twin; how far its apexes differ is what the
simulation gets wrong, without what a training adds.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hopping_leg.controllers.registry import load_policy
from hopping_leg.evaluate.statistics import median_interval
from hopping_leg.robot.parameters import Robot
from hopping_leg.sim_to_real.methods import Method
from hopping_leg.sim_to_real.stages import HopTrial

POLICY = "fast"
"""It corrects itself least, so that its apexes tell most of the leg, and hops on all of them."""

_SEED = 0
"""Of the bootstrap."""


@dataclass(frozen=True)
class Meet(HopTrial):
    """The shipped policy on a twin."""

    @property
    def name(self) -> str:
        """What is done."""
        return f"hop on {self.twin.name}, shipped {POLICY}"

    @property
    def leg(self) -> Robot:
        """The twin."""
        return self.twin.robot

    @property
    def file(self) -> Path:
        """Of the result."""
        return self.study.folder / "predictions" / f"{self.twin.name}.json"

    @property
    def policy(self) -> bytes:
        """The shipped policy."""
        return load_policy(POLICY).content


@dataclass(frozen=True)
class Foretell(Meet):
    """The shipped policy in what a method believes a twin to be."""

    method: Method

    @property
    def name(self) -> str:
        """What is done."""
        return f"foretell {self.twin.name}, {self.method.name}"

    @property
    def leg(self) -> Robot:
        """The method's simulation."""
        return self.study.simulated(self.twin, self.method)

    @property
    def file(self) -> Path:
        """Of the result."""
        return self.study.folder / "predictions" / f"{self.twin.name}-{self.method.name}.json"


def prediction_rows(foretold: Sequence[Foretell], met: Sequence[Meet]) -> list[dict[str, Any]]:
    """Return how far each method's predicted apexes are off, one row per method.

    A leg that does not hop counts with an apex of zero.

    Args:
        foretold: In each method's simulation of every twin, done.
        met: On every twin, done.

    Returns:
        Medians over twins and commands, intervals over twins; ``errors_m`` are predicted minus
        measured apexes by twin and command, m.
    """
    true = {job.twin.name: _apexes(job) for job in met}
    rows = []
    for method in dict.fromkeys(job.method for job in foretold):
        errors = {
            job.twin.name: _apexes(job) - true[job.twin.name]
            for job in foretold
            if job.method == method
        }
        absolute = [np.abs(error) for error in errors.values()]
        low, high = median_interval(absolute, _SEED)
        rows.append({
            "method": method.name,
            "meaning": method.meaning,
            "median_abs_error_m": float(np.median(np.concatenate(absolute))),
            "median_abs_error_low_m": low,
            "median_abs_error_high_m": high,
            "worst_abs_error_m": float(np.max(np.concatenate(absolute))),
            "median_error_m": float(np.median(np.concatenate(list(errors.values())))),
            "errors_m": {name: error.tolist() for name, error in errors.items()},
        })  # fmt: skip
    return rows


def _apexes(job: Meet) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Return the median apex at every command, m."""
    return np.array([row["command_m"] + row["median_error_m"] for row in job.measured()])
