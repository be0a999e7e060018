"""A population evaluated on a Ray cluster, with the same bits as on this machine."""

from collections.abc import Callable

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.cluster import RayCluster

Evaluate = Callable[[Array], Array]
"""Search vectors (n, k) to costs (n,) or residuals (n, m), row by row independent."""


class Cluster:
    """Spreads populations over the workers of a Ray cluster.

    A candidate's simulation does not depend on which candidates share its batch, so splitting a
    population changes nothing but the time.

    Args:
        evaluate: What each worker runs; sent to them once.
        address: Of the cluster, or None to start one on this machine.
        workers: How many parts to cut a population into; None takes one per CPU of the cluster.

    Raises:
        UsageError: Ray is not installed or the cluster cannot be reached.
    """

    def __init__(
        self, evaluate: Evaluate, address: str | None = None, workers: int | None = None
    ) -> None:
        self._cluster = RayCluster(address)
        self.workers = workers or self._cluster.cores
        self._evaluate = self._cluster.put(evaluate)

    def __call__(self, vectors: Array) -> Array:
        """Return what ``evaluate`` returns, in the population's order."""
        parts = split_population(vectors, self.workers)
        calls = ((self._evaluate, part) for part in parts)
        return np.concatenate(self._cluster.map(_evaluate_part, calls))


def split_population(vectors: Array, workers: int) -> list[Array]:
    """Cut a population (n, k) into at most ``workers`` parts of nearly equal size, in order."""
    return np.array_split(vectors, min(workers, len(vectors)))


def _evaluate_part(evaluate: Evaluate, vectors: Array) -> Array:
    return evaluate(vectors)
