"""What is measured, and results that are kept so that finished parts are not repeated."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Self

from hopping_leg.evaluate.result import ResultCache
from hopping_leg.identify.optimizers import Report
from hopping_leg.identify.result import software_versions


@dataclass(frozen=True)
class Study:
    """Sizes and efforts."""

    seconds: float = 16.0
    """Of each recording of a known twin."""
    generations: int = 100
    """Of CMA-ES, in each pass."""
    population: int = 16
    """Candidates of a generation."""
    paper_seconds: float = 240.0
    """Of each recording of the paper's size; the paper's are of 240 s."""
    arms: int = 120
    """Independent arms whose truth intervals have to hold."""
    threads: int = 2
    """Of the fits; results do not depend on it."""
    seed: int = 0
    """Of CMA-ES."""
    searches: tuple[str, ...] = ("least-squares", "cma", "two-pass")
    """Of known twins and of recordings of the paper's size; those that a case has."""

    def asked(self, search: str, seconds: float) -> dict[str, Any]:
        """Return what a fit's result depends on.

        Args:
            search: How.
            seconds: Of each recording.
        """
        effort = {"generations": self.generations, "population": self.population}
        return {
            "search": search,
            "seconds": seconds,
            "threads": self.threads,
            "seed": self.seed,
            **({} if search == "least-squares" else effort),
        }


@dataclass(frozen=True)
class FitCache(ResultCache):
    """Also knows software and tells of fits.

    Attributes:
        report: Told how a fit goes.
    """

    report: Report = lambda stage, share, cost: None

    def load_or_run(
        self, name: str, words: str, asked: dict[str, Any], work: Callable[[], dict[str, Any]]
    ) -> dict[str, Any]:
        """Return the kept result of the same work by the same software, or do it and keep it."""
        return super().load_or_run(name, words, {**asked, "software": software_versions()}, work)


class Clock:
    """Wall and processor seconds since it was started, over all threads, as a context manager."""

    def __enter__(self) -> Self:
        """Start."""
        self._wall, self._cpu = time.perf_counter(), time.process_time()
        return self

    def __exit__(self, *_: object) -> None:
        """Stop."""
        self.wall = time.perf_counter() - self._wall
        self.cpu = time.process_time() - self._cpu
