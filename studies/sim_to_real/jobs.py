"""Jobs whose results are kept: what is done is not done again, what was killed goes on."""

import json
from abc import ABC, abstractmethod
from collections.abc import Sequence
from concurrent.futures import as_completed
from pathlib import Path
from typing import Any

from hopping_leg.errors import UsageError
from hopping_leg.progress import ShareProgress
from hopping_leg.sim import compile_physics
from hopping_leg.workers import ProcessWorkers


class Job(ABC):
    """Something to do once; it can be sent to another process."""

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


def work_through(stages: Sequence[Sequence[Job]], at_once: int = 1) -> None:
    """Do what is not done of some stages, one stage after the other.

    Jobs of a stage are independent. With one at once they run in this process and show their own
    progress.
    """
    for number, stage in enumerate(stages, 1):
        left = [job for job in stage if not job.done]
        if at_once == 1:
            for job in left:
                job.run(quiet=False)
        elif left:
            _share_out(left, at_once, f"stage {number} of {len(stages)}")


def _share_out(jobs: Sequence[Job], at_once: int, label: str) -> None:
    compile_physics()
    with ProcessWorkers(min(at_once, len(jobs))) as workers, ShareProgress() as progress:
        running = {workers.submit(_run, job): job for job in jobs}
        for count, future in enumerate(as_completed(running), 1):
            future.result()
            progress.show(label, count / len(jobs))


def _run(job: Job) -> None:
    if not job.done:
        job.run(quiet=True)
