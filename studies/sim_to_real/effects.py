"""What each of a twin's effects costs: the policy hops once more with one of them taken away."""

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hopping_leg.evaluate.statistics import median_interval
from hopping_leg.robot.model_mismatch import (
    DriveMismatch,
    GroundMismatch,
    Latency,
    MassScale,
    ModelMismatch,
)
from hopping_leg.robot.parameters import Robot
from hopping_leg.sim_to_real.stages import HopOnTwin

Without = Callable[[ModelMismatch], ModelMismatch]

_SEED = 0
"""Of the bootstrap."""


def _drives(*names: str) -> Without:
    """Return what makes attributes of both drives neutral."""
    neutral = {name: getattr(DriveMismatch(), name) for name in names}

    def without(reality: ModelMismatch) -> ModelMismatch:
        hip, knee = (dataclasses.replace(d, **neutral) for d in (reality.hip, reality.knee))
        return dataclasses.replace(reality, hip=hip, knee=knee)

    return without


EFFECTS: dict[str, Without] = {
    "latency": lambda reality: dataclasses.replace(reality, latency=Latency()),
    "motor": lambda reality: _drives("torque_gain", "torque_lag", "torque_limit", "ripple")(
        dataclasses.replace(reality, voltage=1.0)
    ),
    "losses": _drives("efficiency", "stiction"),
    "backlash": _drives("backlash"),
    "belt": _drives("stiffness", "stiffness_damping"),
    "sensors": _drives("sensor"),
    "masses": lambda reality: dataclasses.replace(
        reality, mass=MassScale(), ground=GroundMismatch()
    ),
}
"""Effects of ``[reality]`` by name, and what takes each away."""


@dataclass(frozen=True)
class HopWithout(HopOnTwin):
    """A policy tried on a twin that lacks one effect."""

    effect: str

    @property
    def name(self) -> str:
        """What is done."""
        return f"{super().name}, without {self.effect}"

    @property
    def leg(self) -> Robot:
        """The twin without the effect."""
        robot = self.twin.robot
        return dataclasses.replace(robot, reality=EFFECTS[self.effect](robot.reality))

    @property
    def suffix(self) -> str:
        """Of the file."""
        return f"-without-{self.effect}"


def effect_rows(hops: Sequence[HopOnTwin], without: Sequence[HopWithout]) -> list[dict[str, Any]]:
    """Return the errors with every effect and with each taken away, one row each.

    Args:
        hops: On the twins as they are.
        without: On the twins with one effect less.
    """
    kinds = {"all effects": list(hops)}
    for job in without:
        kinds.setdefault(f"without {job.effect}", []).append(job)
    return [_row(kind, jobs) for kind, jobs in kinds.items()]


def _row(kind: str, jobs: Sequence[HopOnTwin]) -> dict[str, Any]:
    rows = [row for job in jobs for row in job.rows()]
    twins = dict.fromkeys(row["twin"] for row in rows)
    errors = [np.array([r["median_abs_error_m"] for r in rows if r["twin"] == t]) for t in twins]
    low, high = median_interval(errors, _SEED)
    stds = [row["std_m"] for row in rows if row["hops"]]
    return {
        "twin": kind,
        "median_abs_error_m": float(np.median(np.concatenate(errors))),
        "median_abs_error_low_m": low,
        "median_abs_error_high_m": high,
        "worst_abs_error_m": float(np.max(np.concatenate(errors))),
        "median_std_m": float(np.median(stds)) if stds else None,
        "skipped_hops": sum(row["skipped_hops"] for row in rows),
    }
