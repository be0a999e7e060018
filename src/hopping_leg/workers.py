"""Work shared out, to processes of this machine or to a Ray cluster, with the same results."""

import os
import signal
import socket
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import Any, Self, TypeVar

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.errors import HoppingLegError, UsageError

R = TypeVar("R")
T = TypeVar("T")

_PATIENCE = 5.0  # how long an address may take to answer, s


class ProcessWorkers:
    """Processes of this machine, as many as ``count``, 0 for one per core, as a context manager.

    They end with it, and with this process, however that one ends: the same command, given again,
    must not find its old workers still writing. The work of a single one is done in this process.
    """

    def __init__(self, count: int = 0) -> None:
        self.count = count or os.cpu_count() or 1

    def __enter__(self) -> Self:
        """Make ready; processes begin with the first work."""
        context = get_context("spawn")
        ended, self._alive = context.Pipe(duplex=False)
        self._pool = ProcessPoolExecutor(self.count, context, _watch, (ended,))
        return self

    def map(self, function: Callable[..., R], arguments: Iterable[tuple[Any, ...]]) -> Iterator[R]:
        """Call a function once per tuple of arguments; yield what it returns, in their order.

        Arguments are taken as workers get free, so that they may be endless. A task's
        HoppingLegError is raised here, UsageError where a worker died.
        """
        if self.count == 1:
            yield from (function(*values) for values in arguments)
            return
        begun = (self._pool.submit(function, *values) for values in arguments)
        try:
            yield from _in_order(begun, Future.result, self.count)
        except BrokenProcessPool as error:
            raise UsageError(
                "A worker ended early; call the same command again to go on."
            ) from error

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """End the processes, and what they do if an error ends the work."""
        self._pool.shutdown(wait=kind is None, cancel_futures=True)
        self._alive.close()


def _watch(ended: Connection) -> None:
    """Leave interruptions to the parent, and end with it: then nobody holds the other end."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def watch() -> None:
        ended.poll(None)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


class RayWorkers:
    """The CPUs of a Ray cluster; one that this process has joined already stays the one.

    Its address is ``local`` or None for one that is started on this machine and ends with this
    process. As many tasks run at once as it has CPUs. UsageError says that Ray is not installed or
    the cluster cannot be reached.
    """

    def __init__(self, address: str | None = None) -> None:
        # Otherwise a cluster that is started here tells its makers about itself.
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
        try:
            import ray
        except ModuleNotFoundError as error:
            raise UsageError(
                "A cluster needs Ray; install it with `pip install 'hopping-leg[cluster]'`."
            ) from error
        self._ray = ray
        if not ray.is_initialized():
            try:
                # At once where nothing answers; Ray itself would try for minutes.
                host, _, port = (address or "").removeprefix("ray://").rpartition(":")
                if host and port.isdigit():
                    socket.create_connection((host, int(port)), _PATIENCE).close()
                ray.init(address=address or "local", log_to_driver=False)
            except (OSError, ValueError, RuntimeError) as error:
                raise UsageError(
                    f"There is no Ray cluster at {address or 'local'}: {str(error).rstrip('.')};"
                    " start one with `ray start --head`, or leave the address out."
                ) from error
        for name in [name for name in sys.modules if name.startswith("hopping_leg_user_file_")]:
            # Other processes cannot import it: its code goes with what is sent.
            ray.cloudpickle.register_pickle_by_value(sys.modules[name])
        self.count = max(1, int(ray.cluster_resources().get("CPU", 1)))

    def map(self, function: Callable[..., R], arguments: Iterable[tuple[Any, ...]]) -> Iterator[R]:
        """As ``ProcessWorkers`` does; a task that dies begins again, the function is sent once."""
        sent, task = self._ray.put(function), self._ray.remote(lambda f, *values: f(*values))
        begun = (task.remote(sent, *values) for values in arguments)
        with self._one_sentence():
            yield from _in_order(begun, self._ray.get, self.count)

    @contextmanager
    def _one_sentence(self) -> Iterator[None]:
        try:
            yield
        except self._ray.exceptions.RayTaskError as error:
            if isinstance(error.cause, HoppingLegError):
                raise error.cause from None
            raise
        except self._ray.exceptions.RayError as error:
            raise UsageError(
                f"A worker of the Ray cluster died: {str(error).splitlines()[0].rstrip('.')}; call"
                " the same command again to go on, a training with --resume."
            ) from error


def _in_order(begun: Iterator[T], result: Callable[[T], R], count: int) -> Iterator[R]:
    """Yield results in the order in which they were begun, twice ``count`` ahead."""
    waiting: deque[T] = deque()
    for task in begun:
        waiting.append(task)
        if len(waiting) == 2 * count:
            yield result(waiting.popleft())
    yield from map(result, waiting)


class WorkerGroup:
    """Objects of a kind, one for each of some arguments, that take turns in this process, ``here``.

    With a Ray cluster, those beyond the first work there at once, on a CPU each; UsageError says
    that it has too few.
    """

    def __init__(
        self, kind: type[Any], arguments: Sequence[tuple[Any, ...]], address: str | None = None
    ) -> None:
        self.count, self._there = len(arguments), list[Any]()
        if address is not None:
            self._cluster = RayWorkers(address)
            if self.count - 1 > self._cluster.count:
                raise UsageError(
                    f"{self.count} workers need one CPU less on the cluster, beside this process,"
                    f" which has {self._cluster.count}; give fewer."
                )
            actor = self._cluster._ray.remote(num_cpus=1)(kind)
            self._there = [actor.remote(*values) for values in arguments[1:]]
        self.here = [kind(*values) for values in arguments[: self.count - len(self._there)]]

    def call(self, method: str, *shared: Any, each: Sequence[Any] | None = None) -> list[Any]:  # noqa: ANN401
        """Call all with what is ``shared`` and their own of ``each``; return results in order."""
        own = [()] * self.count if each is None else [(value,) for value in each]
        begun, here = [], zip(self.here, own, strict=False)
        if self._there:
            sent = [self._cluster._ray.put(value) for value in shared]
            others = zip(self._there, own[1:], strict=True)
            begun = [getattr(one, method).remote(*sent, *values) for one, values in others]
        found = [getattr(one, method)(*shared, *values) for one, values in here]
        if begun:
            with self._cluster._one_sentence():
                found += self._cluster._ray.get(begun)
        return found

    def state(self) -> list[Any]:
        """Return the ``state`` of each."""
        return self.call("state")

    def restore(self, states: Sequence[Any]) -> None:
        """Let each go on from its ``state``."""
        self.call("restore", each=states)


Workers = ProcessWorkers | RayWorkers
"""What shares work out: ``count`` tasks at once, called by ``map``."""


def map_rows(workers: Workers, function: Callable[[Array], Array], rows: Array) -> Array:
    """Return what a function of independent rows (n, k) returns, computed in about equal parts."""
    parts = np.array_split(rows, min(workers.count, len(rows)))
    return np.concatenate(list(workers.map(function, ((part,) for part in parts))))
