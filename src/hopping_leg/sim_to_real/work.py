"""Many independent jobs, some at a time in processes of their own, with progress at all times.

A job that is done is not done again, so that a study that was killed goes on where it was.
"""

from collections.abc import Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from typing import Protocol

from hopping_leg.sim_to_real.board import Board
from hopping_leg.workers import ProcessWorkers

_LOOK_EVERY = 1.0


class Job(Protocol):
    """Something to do once; it can be sent to another process."""

    @property
    def weight(self) -> float:
        """Rough time it takes one core, min, for the time left."""
        ...

    @property
    def name(self) -> str:
        """What is done."""
        ...

    @property
    def done(self) -> bool:
        """Whether its result is stored."""
        ...

    def run(self, *, quiet: bool) -> None:
        """Do it and store the result, whole or not at all."""
        ...

    def progress(self) -> tuple[float, str]:
        """Return the share done and what to show while it runs in another process."""
        ...


def work(jobs: Sequence[Job], at_once: int, board: Board) -> None:
    """Do every job that is not done.

    Args:
        jobs: Independent of each other.
        at_once: How many processes; with one, jobs run in this process and show their own progress.
        board: Shows how it goes.
    """
    left = []
    for job in jobs:
        if job.done:
            board.finish(job.name, job.weight, new=False)
        else:
            left.append(job)
    if at_once == 1:
        for job in left:
            board.begin(job.name)
            job.run(quiet=False)
            board.finish(job.name, job.weight)
    elif left:
        _share_out(left, at_once, board)


def _share_out(jobs: Sequence[Job], at_once: int, board: Board) -> None:
    with ProcessWorkers(min(at_once, len(jobs))) as workers:
        running = {workers.submit(_run, job): job for job in jobs}
        while running:
            ended, _ = wait(running, _LOOK_EVERY, FIRST_COMPLETED)
            for future in ended:
                job = running.pop(future)
                future.result()
                board.finish(job.name, job.weight)
            _show(running, at_once, board)


def _show(running: dict[Future[None], Job], at_once: int, board: Board) -> None:
    busy = [job for future, job in running.items() if future.running() and not job.done]
    notes, begun = [], 0.0
    for job in busy[:at_once]:
        share, note = job.progress()
        notes.append(f"{job.name} {note}".strip())
        begun += share * job.weight
    board.show(notes, begun)


def _run(job: Job) -> None:
    if not job.done:
        job.run(quiet=True)
