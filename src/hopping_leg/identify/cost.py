"""How far a simulation is from a recording: the paper's J, and what the data call for beyond it."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from hopping_leg.arrays import Array, BoolArray, IntArray
from hopping_leg.errors import RecordingError
from hopping_leg.identify.hops import base_height, by_hops
from hopping_leg.identify.parameters import ParameterSet
from hopping_leg.identify.recording import Recording
from hopping_leg.identify.simulate import Window, WindowSimulator

IN_FULL = 1e300
"""A level that no residuals reach."""


@dataclass(frozen=True)
class RobustLoss:
    """Loss by which each window's say depends on its own level of errors.

    A window of mean squared residual m, in one quantity of one joint, counts
    2 L (1 - (1 + m / L)^-1/2) with a level L: nearly m far below it, and far beyond it nearly the
    same whatever is changed, so that windows that the model cannot explain hardly move parameters.

    Gauss-Newton steps on such a cost are those on residuals that are weighted by the levels of the
    moment; the rest of the cost beside their squares is residuals that no parameter moves.
    """

    groups: IntArray
    """Number of each residual's group, (size,)."""
    level: float | Array
    """Mean squared residual beyond which a group counts ever less, (groups,); ``IN_FULL``: none."""

    @cached_property
    def sizes(self) -> IntArray:
        """Residuals in each group, (groups,)."""
        return np.bincount(self.groups)

    def weights(self, residuals: Array) -> Array:
        """Return factors of one hypothesis's residuals at its own levels, (size,)."""
        return np.asarray(((1 + self._squares(residuals)) ** -0.75)[self.groups])

    def rest(self, residuals: Array) -> Array:
        """Return the root of what each group costs beside its weighted residuals, (groups,)."""
        squares = self._squares(residuals)
        root = np.sqrt(1 + squares)
        # 2 (1 - 1 / root) - squares / root**3 without the cancellation of small squares
        share = (squares / (root + 1)) ** 2 * (2 * root + 1) / root**3
        return np.asarray(np.sqrt(self.sizes * self.level * share))

    def levelled(self, residuals: Array) -> Array:
        """Return weighted residuals and what is beside them, whose squares add up to the cost."""
        return np.concatenate([self.weights(residuals) * residuals, self.rest(residuals)])

    def _squares(self, residuals: Array) -> Array:
        """Return groups' mean squared residuals in units of the level, (groups,)."""
        total = np.bincount(self.groups, np.square(residuals), len(self.sizes))
        return np.asarray(total / np.maximum(self.sizes, 1) / self.level)


_QUANTITIES = ("position", "torque", "height")
_FAILED = 1e3  # residual of a simulation that broke down, in units of the scales


@dataclass(frozen=True)
class Scoring:
    """What counts and how much: a residual is an error divided by its quantity's scale.

    The paper's J, the sum of squared joint position errors in rad2, is the default.
    """

    position: float | None = 1.0
    """Scale of position errors, rad; None leaves positions out."""
    torque: float | None = None
    """Scale of torque errors, N m."""
    height: float | None = None
    """Scale of errors of the base's height, where it was measured, m."""
    robust: float | None = None
    """Residuals well beyond this many scales count linearly instead of squared."""
    unexplained: float | None = None
    """Mean squared residual of a window, in one quantity of one joint, beyond which the
    window counts ever less, so that what no parameters explain hardly moves them."""
    in_full: tuple[str, ...] = ()
    """Quantities of which every window counts in full nevertheless."""


@dataclass(frozen=True)
class Objective:
    """What a search minimises: residuals and costs of search vectors.

    Only measured samples with an exact time stamp count, after each window's unscored rows. An
    objective can be sent to other machines, where it builds its simulations anew.
    """

    recordings: tuple[Recording, ...]
    windows: tuple[Window, ...]
    parameters: ParameterSet
    scoring: Scoring
    threads: int = 0
    """Worker threads, 0 for one per core."""

    @cached_property
    def simulator(self) -> WindowSimulator:
        """The simulations."""
        return WindowSimulator(self.recordings, self.windows, threads=self.threads)

    @cached_property
    def _scored(self) -> dict[str, tuple[float, Array, BoolArray]]:
        """Scale, measured values and which of them count, by quantity."""
        scored = {}
        for name in _QUANTITIES:
            if (scale := getattr(self.scoring, name)) is not None:
                values = measured(self.simulator, name)
                scored[name] = (scale, values, ~np.isnan(values))
        if not any(mask.any() for _, _, mask in scored.values()):
            raise RecordingError(f"There is no measured sample; record {' or '.join(scored)}.")
        return scored

    @cached_property
    def groups(self) -> IntArray:
        """Number of each residual's group: a window's, in one quantity of one joint, (size,)."""
        parts, first = [], 0
        for _, _, mask in self._scored.values():
            count = len(mask) * mask[0, 0].size
            numbers = first + np.arange(count).reshape(len(mask), 1, *mask.shape[2:])
            parts.append(np.broadcast_to(numbers, mask.shape)[mask])
            first += count
        return np.concatenate(parts)

    @cached_property
    def loss(self) -> RobustLoss:
        """What windows that no parameters explain are worth."""
        level, whole = self.scoring.unexplained or IN_FULL, self.scoring.in_full
        counts = [len(mask) * mask[0, 0].size for _, _, mask in self._scored.values()]
        levels = np.repeat([IN_FULL if q in whole else level for q in self._scored], counts)
        return RobustLoss(self.groups, levels[: self.groups.max() + 1])

    @property
    def jumping(self) -> IntArray | None:
        """Groups of the residuals, (size,), if feet touch down, which makes them jump."""
        clamped = all(r.metadata.rig == "fixed-base" for r in self.recordings)
        return None if clamped else self.groups

    def residuals(self, vectors: Array) -> Array:
        """Return residuals of search vectors (n, k) in units of the scales, (n, size)."""
        simulated = self.simulator.run(self.parameters.hypotheses(vectors))
        parts = [
            (getattr(simulated, name) - values)[:, mask] / scale
            for name, (scale, values, mask) in self._scored.items()
        ]
        joined = np.ascontiguousarray(np.concatenate(parts, axis=1))
        raw: Array = np.clip(np.nan_to_num(joined, nan=_FAILED), -_FAILED, _FAILED)
        if (bound := self.scoring.robust) is None:
            return raw
        squares = 2 * bound**2 * (np.sqrt(1 + np.square(raw / bound)) - 1)
        return np.asarray(np.copysign(np.sqrt(squares), raw))

    def __call__(self, vectors: Array) -> Array:
        """Return the costs of search vectors (n, k), by default the paper's J, (n,)."""
        return np.array([np.sum(self.loss.levelled(r) ** 2) for r in self.residuals(vectors)])

    def __getstate__(self) -> dict[str, Any]:
        cached = ("simulator", "_scored", "groups", "loss")
        return {k: v for k, v in self.__dict__.items() if k not in cached}


def measured(simulator: WindowSimulator, quantity: str) -> Array:
    """Return what was measured in each window and counts, else NaN.

    Of shape (windows, rows, 2), or (windows, rows) if the quantity is the base's ``height``.
    """
    of_joints = () if quantity == "height" else (2,)
    values = np.full((len(simulator.windows), simulator.rows, *of_joints), np.nan)
    for i, w in enumerate(simulator.windows):
        recording = simulator.recordings[w.recording]
        rows = slice(w.start + w.unscored, w.start + w.length)
        if of_joints:
            sampled = recording.array(quantity)[rows]
            sampled[(w.joints or w.length) - w.unscored :] = np.nan
        elif recording.metadata.rig == "fixed-base":
            continue
        else:
            height = base_height(recording)
            sampled = height[rows] - (height[w.start] if by_hops(recording) else 0.0)
        sampled[~recording.exact_time[rows]] = np.nan
        values[i, w.unscored : w.length] = sampled
    return values
