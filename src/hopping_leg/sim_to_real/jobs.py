"""Jobs of a sim-to-real study: each is done once, some at a time in processes of their own."""

import json
import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from concurrent.futures import FIRST_COMPLETED, wait
from pathlib import Path
from typing import Any, ClassVar

from hopping_leg.errors import UsageError
from hopping_leg.progress import LiveProgress
from hopping_leg.sim import compile_physics
from hopping_leg.workers import ProcessWorkers

_LOOK_EVERY = 1.0
_MOST_GUESSED = 0.95
_BELIEVED = 10.0
"""Work, s, after which the pace of this computer counts as much as that of the weights."""


_KNOWN = 0.1
"""Share of the work that is begun when the pace is known though no job has ended."""


class Board(LiveProgress):
    """Shows which jobs run and how much of their total weight is left, as a context manager.

    Where jobs draw bars of their own, there is a line per job instead of a bar.

    Args:
        total: Weight of all that is shown, what follows the jobs included, s of a core.
        at_once: How many cores work.
        own_bars: Whether jobs draw bars of their own.
    """

    def __init__(self, total: float, at_once: int = 1, *, own_bars: bool = False) -> None:
        super().__init__("transfer", lines=True if own_bars else None)
        self._total, self.at_once = total, at_once
        self._old, self._new, self._begun = 0.0, 0.0, 0.0

    def begin(self, name: str) -> None:
        """Say that a job begins in this process."""
        self._tell(name, at_once=True)

    def finish(self, name: str, weight: float, *, new: bool = True) -> None:
        """Count a job; one that is not new was done by an earlier run."""
        self._begun = max(0.0, self._begun - weight)
        if new:
            self._new += weight
            self._tell(f"done: {name}", at_once=True)
        else:
            self._old += weight

    def show(self, notes: Sequence[str], begun: float = 0.0) -> None:
        """Show a note per running job; ``begun`` is the weight of what is done of them."""
        self._begun = begun
        self._tell(" · ".join(notes))

    def _tell(self, note: str, *, at_once: bool = False) -> None:
        known = self._new > 0 or self._begun > _KNOWN * self._total
        left = (self._total - self._done) * self.pace / self.at_once if known else math.nan
        share = self._done / max(self._total, 1e-9)
        self._show("transfer", "transfer", share, note, left, at_once=at_once)

    @property
    def _done(self) -> float:
        return self._old + self._new + self._begun

    @property
    def pace(self) -> float:
        """How long work takes, over what the weights say."""
        new = self._new + self._begun
        return (self.passed * self.at_once + _BELIEVED) / (new + _BELIEVED)


class Job(ABC):
    """Something to do once; it can be sent to another process."""

    @property
    @abstractmethod
    def weight(self) -> float:
        """Rough time that it keeps one core busy, s; a job on all cores counts all of them."""

    on_all_cores: ClassVar[bool] = False
    """Whether one alone keeps every core busy."""

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
        """Return the share that is known to be done in another process, and what to show."""
        return 0.0, ""


class StoredJob(Job):
    """A job whose result is a file, stored with the options that it depends on."""

    file: Path

    @property
    @abstractmethod
    def asked(self) -> dict[str, Any]:
        """Options that the result depends on, as JSON values."""

    @property
    def stored(self) -> dict[str, Any]:
        """Options that the stored result was made with; others may stand beside them."""
        text = self.file.with_suffix(".json").read_text(encoding="utf-8")
        asked: dict[str, Any] = json.loads(text)["asked"]
        return asked

    @property
    def done(self) -> bool:
        """Whether the result is stored.

        Raises:
            UsageError: It is stored, but of other options.
        """
        if not self.file.exists():
            return False
        stored = self.stored
        other = [name for name, value in self.asked.items() if stored.get(name) != value]
        if other:
            raise UsageError(
                f"{self.file} was made with other options ({', '.join(other)}); give another"
                " folder, or delete it to make it again."
            )
        return True


def work_through(
    rounds: Sequence[Sequence[Job]], at_once: int = 1, afterwards: float = 0.0
) -> None:
    """Do what is not done of some stages, one stage after the other.

    What the caller does ``afterwards``, s of a core, counts in the time left.
    """
    total = afterwards + sum(job.weight for stage in rounds for job in stage)
    with Board(total, at_once, own_bars=at_once == 1) as board:
        for stage in rounds:
            work(stage, at_once, board)


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
        since: dict[str, float] = {}
        while running:
            ended, _ = wait(running, _LOOK_EVERY, FIRST_COMPLETED)
            for future in ended:
                job = running.pop(future)
                future.result()
                board.finish(job.name, job.weight)
            busy = [job for future, job in running.items() if future.running() and not job.done]
            _show(busy[:at_once], since, board)


def _show(busy: Sequence[Job], since: dict[str, float], board: Board) -> None:
    """Show what runs; a job that tells nothing new goes on as fast as its weight says."""
    notes, begun = [], 0.0
    for job in busy:
        known, note = job.progress()
        begin = since.setdefault(f"{job.name} {note}", board.passed)
        cores = board.at_once / len(busy) if job.on_all_cores else 1.0
        guessed = known + cores * (board.passed - begin) / (board.pace * job.weight)
        notes.append(f"{job.name} {note}".strip())
        begun += job.weight * min(guessed, max(known, _MOST_GUESSED))
    board.show(notes, begun)


def _run(job: Job) -> None:
    if not job.done:
        job.run(quiet=True)
