"""How far a simulation is from a recording: the paper's J, and what the data call for beyond it."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from hopping_leg.arrays import Array, BoolArray, IntArray
from hopping_leg.errors import RecordingError, UsageError
from hopping_leg.identify.parameters import LegHypothesis, ParameterSet
from hopping_leg.identify.recording import Recording
from hopping_leg.identify.simulate import Simulated, WindowSimulator
from hopping_leg.identify.windows import Window
from hopping_leg.robot.model import TIMESTEP


@dataclass(frozen=True)
class RobustLoss:
    """What residuals are worth beside others of their window.

    Attributes:
        groups: Number of each residual's group, (size,).
        level: Mean squared residual beyond which a group counts ever less.
    """

    groups: IntArray
    level: float

    @cached_property
    def sizes(self) -> IntArray:
        """Residuals in each group, (groups,)."""
        return np.bincount(self.groups)

    def weights(self, residuals: Array) -> Array:
        """Return factors of one hypothesis's residuals at its own levels, (size,)."""
        share: Array = ((1 + self._squares(residuals)) ** -0.75)[self.groups]
        return share

    def rest(self, residuals: Array) -> Array:
        """Return the root of what each group costs beside its weighted residuals, (groups,)."""
        squares = self._squares(residuals)
        root = np.sqrt(1 + squares)
        # 2 (1 - 1 / root) - squares / root**3 without the cancellation of small squares
        share = (squares / (root + 1)) ** 2 * (2 * root + 1) / root**3
        rest: Array = np.sqrt(self.sizes * self.level * share)
        return rest

    def cost(self, residuals: Array) -> float:
        """Return the cost of one hypothesis's residuals, (size,)."""
        weighted = self.weights(residuals) * residuals
        return float(np.sum(weighted**2) + np.sum(self.rest(residuals) ** 2))

    def _squares(self, residuals: Array) -> Array:
        """Return groups' mean squared residuals in units of the level, (groups,)."""
        total = np.bincount(self.groups, np.square(residuals), len(self.sizes))
        mean: Array = total / np.maximum(self.sizes, 1) / self.level
        return mean


def grouping(counts: Sequence[BoolArray]) -> IntArray:
    """Return the number of each residual's group: a window's, in one quantity of one joint.

    Args:
        counts: What counts of each quantity, (windows, rows, ...); residuals are in this order.
    """
    parts, first = [], 0
    for mask in counts:
        columns = mask[0, 0].size
        numbers = first + np.arange(len(mask) * columns).reshape(len(mask), 1, *mask.shape[2:])
        parts.append(np.broadcast_to(numbers, mask.shape)[mask])
        first += len(mask) * columns
    return np.concatenate(parts)


def total_costs(residuals: Array, loss: RobustLoss | None) -> Array:
    """Return the costs of hypotheses' residuals (n, size), (n,).

    Args:
        residuals: Of every hypothesis.
        loss: None counts every residual in full.
    """
    if loss is None:
        total: Array = np.square(residuals).sum(axis=1)
        return total
    return np.array([loss.cost(r) for r in residuals])


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


@dataclass(frozen=True)
class Objective:
    """Residuals and costs of search vectors.

    It can be sent to other machines, where it builds its simulations anew.

    Attributes:
        recordings: What was recorded.
        windows: Which stretches count.
        parameters: What vectors mean.
        scoring: What errors count.
        timestep: Physics step, s.
        threads: Worker threads, 0 for one per core.
    """

    recordings: tuple[Recording, ...]
    windows: tuple[Window, ...]
    parameters: ParameterSet
    scoring: Scoring
    timestep: float = TIMESTEP
    threads: int = 0

    @cached_property
    def cost(self) -> Cost:
        """The simulations and their measured counterparts."""
        simulator = WindowSimulator(
            self.recordings, self.windows, timestep=self.timestep, threads=self.threads
        )
        return Cost(simulator, self.scoring)

    def residuals(self, vectors: Array) -> Array:
        """Return residuals of search vectors (n, k), (n, m)."""
        return self.cost.residuals(self.parameters.hypotheses(vectors))

    @property
    def loss(self) -> RobustLoss | None:
        """What windows that no parameters explain are worth; None counts every one in full."""
        return self.cost.loss

    @property
    def jumping(self) -> IntArray | None:
        """Groups of the residuals, (m,), if feet touch down, which makes them jump; else None."""
        grounded = any(
            self.recordings[w.recording].metadata.rig != "fixed-base" for w in self.windows
        )
        return self.cost.groups if grounded else None

    def __call__(self, vectors: Array) -> Array:
        """Return the costs of search vectors (n, k), (n,)."""
        return total_costs(self.residuals(vectors), self.loss)

    def about(self) -> dict[str, Any]:
        """Return what tells this objective from others, for checkpoints."""
        return {
            "recordings": [r.digest or r.name for r in self.recordings],
            "windows": repr(self.windows),
            "base": repr(self.parameters.base),
            "scoring": repr(self.scoring),
            "timestep": self.timestep,
        }

    def __getstate__(self) -> dict[str, Any]:
        return {k: v for k, v in self.__dict__.items() if k != "cost"}
