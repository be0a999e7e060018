"""How far a simulation is from a recording: the paper's J, and what the data call for beyond it."""

from dataclasses import dataclass

import numpy as np

from hopping_leg.arrays import Array, BoolArray
from hopping_leg.errors import RecordingError, UsageError
from hopping_leg.identify.leg_hypothesis import LegHypothesis
from hopping_leg.identify.robust_loss import RobustLoss, grouping, total_costs
from hopping_leg.identify.simulate import Simulated, WindowSimulator

_QUANTITIES = ("position", "velocity", "torque", "height")
_FAILED = 1e3
"""Residual of a simulation that broke down, in units of the scales."""


@dataclass(frozen=True)
class Scoring:
    """What counts and how much: a residual is an error divided by its quantity's scale.

    The paper's J, the sum of squared joint position errors in rad2, is the default.

    Raises:
        UsageError: A scale is not positive, or nothing counts.
    """

    position: float | None = 1.0
    """Scale of position errors, rad; None leaves positions out."""
    velocity: float | None = None
    """Scale of velocity errors, rad/s."""
    torque: float | None = None
    """Scale of torque errors, N m."""
    height: float | None = None
    """Scale of errors of the base's height, where it was measured, m."""
    robust: float | None = None
    """Residuals well beyond this many scales count linearly instead of squared."""
    unexplained: float | None = None
    """Mean squared residual of a window, in one quantity of one joint, beyond which the
    window counts ever less, so that what no parameters explain hardly moves them."""

    def __post_init__(self) -> None:
        for name in (*_QUANTITIES, "robust", "unexplained"):
            value = getattr(self, name)
            if value is not None and not 0 < value < np.inf:
                raise UsageError(f"The scoring's {name} is {value} but must be positive, or none.")
        if all(getattr(self, name) is None for name in _QUANTITIES):
            raise UsageError("The scoring counts nothing; give a scale to position or torque.")


class Cost:
    """Residuals of hypotheses on a simulator's windows.

    Only measured samples with an exact time stamp count, after each window's unscored rows.

    Args:
        simulator: What to simulate.
        scoring: What counts.

    Raises:
        RecordingError: The windows hold no sample that counts.
    """

    def __init__(self, simulator: WindowSimulator, scoring: Scoring | None = None) -> None:
        self.simulator, self.scoring = simulator, scoring or Scoring()
        self._measured = {n: measured(simulator, n) for n in _QUANTITIES if self._scale(n)}
        self._counts: dict[str, BoolArray] = {n: ~np.isnan(v) for n, v in self._measured.items()}
        self.size = sum(int(np.count_nonzero(mask)) for mask in self._counts.values())
        if not self.size:
            raise RecordingError(
                "The windows hold no measured sample of what the scoring counts; record"
                f" {' or '.join(self._measured)}."
            )
        self.groups = grouping(list(self._counts.values()))
        """Number of each residual's window, quantity and joint, (size,)."""
        level = self.scoring.unexplained
        self.loss = None if level is None else RobustLoss(self.groups, level)
        """What windows that no parameters explain are worth; None counts every one in full."""

    def residuals(self, hypotheses: list[LegHypothesis]) -> Array:
        """Return residuals in units of the scales, robust if so chosen, (hypotheses, size)."""
        raw = self.errors(self.simulator.run(hypotheses))
        bound = self.scoring.robust
        if bound is None:
            return raw
        loss = 2 * bound**2 * (np.sqrt(1 + np.square(raw / bound)) - 1)
        robust: Array = np.copysign(np.sqrt(loss), raw)
        return robust

    def errors(self, simulated: Simulated) -> Array:
        """Return scaled errors of a simulation, (hypotheses, size)."""
        parts = []
        for name, mask in self._counts.items():
            error = getattr(simulated, name) - self._measured[name]
            parts.append(error[:, mask] / self._scale(name))
        joined = np.ascontiguousarray(np.concatenate(parts, axis=1))
        finite = np.nan_to_num(joined, nan=_FAILED, posinf=_FAILED)
        bounded: Array = np.clip(finite, -_FAILED, _FAILED)
        return bounded

    def values(self, hypotheses: list[LegHypothesis]) -> Array:
        """Return the costs, by default sums of squared residuals, the paper's J, (hypotheses,)."""
        return total_costs(self.residuals(hypotheses), self.loss)

    def _scale(self, name: str) -> float | None:
        scale: float | None = getattr(self.scoring, name)
        return scale


def measured(simulator: WindowSimulator, quantity: str) -> Array:
    """Return what was measured in each window and counts, else NaN.

    Of shape (windows, rows, 2), or (windows, rows) if the quantity is the base's ``height``.
    """
    of_joints = (2,) if quantity != "height" else ()
    values = np.full((len(simulator.windows), simulator.rows, *of_joints), np.nan)
    for i, w in enumerate(simulator.windows):
        recording = simulator.recordings[w.recording]
        rows = slice(w.start + w.unscored, w.start + w.length)
        if quantity != "height":
            sampled = recording.array(quantity)[rows]
        elif recording.metadata.rig != "fixed-base" and recording.has_column("height_m"):
            sampled = recording.trace.column("height_m")[rows].copy()
        else:
            continue
        sampled[~recording.exact_time[rows]] = np.nan
        values[i, w.unscored : w.length] = sampled
    return values
