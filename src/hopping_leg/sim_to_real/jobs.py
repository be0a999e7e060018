"""Jobs of a sim-to-real study: each is done once, some at a time in processes of their own."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait

from hopping_leg.progress import LiveProgress, minutes
from hopping_leg.sim import compile_physics
from hopping_leg.workers import ProcessWorkers

_LOOK_EVERY = 1.0


class Board(LiveProgress):
    """Shows which jobs run and how much of their total weight is left, as a context manager.

    Where jobs draw bars of their own, there is a line per job instead of a bar.
    """

    def __init__(self, total: float, *, own_bars: bool = False) -> None:
        super().__init__("transfer", total, lines=True if own_bars else None)
        self._total, self._old, self._new, self._begun = total, 0.0, 0.0, 0.0

    def begin(self, name: str) -> None:
        """Say that a job begins in this process."""
        self._line(self._told(name))

    def finish(self, name: str, weight: float, *, new: bool = True) -> None:
        """Count a job; one that is not new was done by an earlier run."""
        self._begun = 0.0
        if new:
            self._new += weight
            self._line(self._told(f"done: {name}"))
        else:
            self._old += weight
        self._bar.update(self._task, completed=self._done)

    def show(self, notes: Sequence[str], begun: float = 0.0) -> None:
        """Show a note per running job; ``begun`` is the weight of what is done of them."""
        self._begun = begun
        note = " · ".join([*notes, self._time_left()])
        self._bar.update(self._task, completed=self._done, note=note)
        self._line_if_due(self._told(note))

    @property
    def _done(self) -> float:
        return self._old + self._new + self._begun

    def _time_left(self) -> str:
        new, left = self._new + self._begun, self._total - self._done
        return f"about {minutes(self.passed / new * left)} left" if new and left > 0 else ""

    def _told(self, text: str) -> str:
        return f"{100 * self._done / max(self._total, 1e-9):.0f} % · {text}"


class Job(ABC):
    """Something to do once; it can be sent to another process."""

    @property
    @abstractmethod
    def weight(self) -> float:
        """Rough time it takes one core, min, for the time left."""

    @property
    @abstractmethod
    def name(self) -> str:
        """What is done."""

    @property
    @abstractmethod
    def done(self) -> bool:
        """Whether its result is stored.

        Raises:
            UsageError: The stored result is of other options.
        """

    @abstractmethod
    def run(self, *, quiet: bool) -> None:
        """Do it and store the result, whole or not at all; what was killed goes on."""

    def progress(self) -> tuple[float, str]:
        """Return the share done and what to show while it runs in another process."""
        return 0.0, ""


def work(jobs: Sequence[Job], at_once: int, board: Board) -> None:
    """Do every job that is not done; they are independent of each other.

    With one at once, jobs run in this process and show their own progress.
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
    compile_physics()
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
