"""Several workers at once: processes on this machine, or tasks of a Ray cluster."""

import multiprocessing
import os
import sys
import threading
from collections.abc import Callable

from hopping_leg.cluster import RayCluster
from hopping_leg.errors import HoppingLegError, UsageError

Work = Callable[[int], None]
"""Works until nothing is left, given the worker's number; it can be sent elsewhere."""


def work_here(work: Work, workers: int) -> None:
    """Work in this process, or in so many of this machine's.

    Raises:
        UsageError: One of several ended early.
    """
    if workers == 1:
        work(0)
        return
    context = multiprocessing.get_context("spawn")
    crew = [context.Process(target=_work_beside, args=(work, k)) for k in range(workers)]
    for process in crew:
        process.start()
    try:
        for process in crew:
            process.join()
    finally:
        for process in crew:
            process.terminate()
    if any(process.exitcode for process in crew):
        raise UsageError("A worker ended early; what it began is taken up by the next call.")


def work_on(cluster: RayCluster, work: Work, workers: int | None = None) -> None:
    """Work in tasks of a Ray cluster, each of which takes one CPU.

    Args:
        cluster: Starts a task that dies again, on another machine if its own is gone.
        work: Done by each task.
        workers: How many tasks; None takes one per CPU.
    """
    cluster.map(work, ((k,) for k in range(workers or cluster.cores)))


def _work_beside(work: Work, worker: int) -> None:
    """Work in a process of its own, which an interruption ends without a word.

    It ends with the process that began it, too, however that one ends: the same command, given
    again, must not find its old workers still writing.
    """
    threading.Thread(target=_end_with_parent, daemon=True).start()
    try:
        work(worker)
    except KeyboardInterrupt:
        raise SystemExit(1) from None
    except HoppingLegError as error:
        print(f"Worker {worker}: {error}", file=sys.stderr)
        raise SystemExit(1) from None


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
