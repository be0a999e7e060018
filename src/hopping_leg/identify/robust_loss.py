"""Errors that no parameters explain: each window's say depends on its own level of errors.

A window whose mean squared residual m, in one quantity of one joint, is beyond a level L counts
2 L (1 - (1 + m / L)^-1/2): nearly m far below the level, and far beyond it nearly the same whatever
is changed. So windows that the model cannot explain, as where a drive saturates, hardly move the
parameters, while those that it explains in part keep some say.

Gauss-Newton steps on such a cost are those on residuals that are weighted by the levels of the
moment; the rest of the cost beside their squares is residuals that no parameter moves.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hopping_leg.arrays import Array, BoolArray, IntArray


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
