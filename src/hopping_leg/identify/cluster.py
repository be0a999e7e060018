"""A population evaluated on a Ray cluster, with the same bits as on this machine."""

import socket
from collections.abc import Callable
from typing import Any

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.errors import UsageError

Evaluate = Callable[[Array], Array]
"""Search vectors (n, k) to costs (n,) or residuals (n, m), row by row independent."""


_PATIENCE = 5.0
"""How long an address may take to answer, s."""


class Cluster:
    """Spreads populations over the workers of a Ray cluster.

    A candidate's simulation does not depend on which candidates share its batch, so splitting a
    population changes nothing but the time.

    Args:
        evaluate: What each worker runs; sent to them once.
        address: Of the cluster, or None to use this machine's cores without a server.
        workers: How many parts to cut a population into; None takes one per CPU of the cluster.

    Raises:
        UsageError: Ray is not installed or the cluster cannot be reached.
    """

    def __init__(
        self, evaluate: Evaluate, address: str | None = None, workers: int | None = None
    ) -> None:
        self._ray = _import_ray()
        if not self._ray.is_initialized():
            try:
                _knock(address)
                self._ray.init(address=address, log_to_driver=False)
            except (OSError, ValueError, RuntimeError) as error:
                raise UsageError(
                    f"There is no Ray cluster at {address}: {str(error).rstrip('.')}; start one"
                    " with `ray start --head`, or leave the address out."
                ) from error
        self.workers = workers or max(1, int(self._ray.cluster_resources().get("CPU", 1)))
        self._evaluate = self._ray.put(evaluate)
        self._remote = self._ray.remote(_evaluate_part)

    def __call__(self, vectors: Array) -> Array:
        """Return what ``evaluate`` returns, in the population's order."""
        parts = split_population(vectors, self.workers)
        return np.concatenate(
            self._ray.get([self._remote.remote(self._evaluate, part) for part in parts])
        )


def split_population(vectors: Array, workers: int) -> list[Array]:
    """Cut a population (n, k) into at most ``workers`` parts of nearly equal size, in order."""
    return np.array_split(vectors, min(workers, len(vectors)))


def _knock(address: str | None) -> None:
    """Fail at once where nothing answers; Ray itself would try for minutes.

    Raises:
        OSError: Nothing answers at an address of the form ``host:port``.
    """
    host, _, port = (address or "").removeprefix("ray://").rpartition(":")
    if host and port.isdigit():
        socket.create_connection((host, int(port)), _PATIENCE).close()


def _evaluate_part(evaluate: Evaluate, vectors: Array) -> Array:
    return evaluate(vectors)


def _import_ray() -> Any:  # noqa: ANN401
    try:
        import ray
    except ModuleNotFoundError as error:
        raise UsageError(
            "A cluster needs Ray; install it with `pip install 'hopping-leg[cluster]'`."
        ) from error
    return ray
