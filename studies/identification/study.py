"""Sizes and efforts, and how a fit is timed and kept."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from hopping_leg.identify.result import LIBRARIES, Identified
from hopping_leg.io import versions
from studies.shared import Row, once


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
    out: Path = Path("runs/bench-identify")
    """Where results are kept; finished parts are not repeated."""

    def once(self, name: str, asked: Row, work: Callable[..., Row], *arguments: object) -> Row:
        """Return the kept result of the same work by the same software, or do it and keep it."""
        asked = {**asked, "software": versions(*LIBRARIES)}
        return once(self.out / f"{name}.json", asked, work, self, *arguments)

    def asked(self, search: str, seconds: float) -> Row:
        """Return what a fit to recordings of so many seconds depends on."""
        effort = {"generations": self.generations, "population": self.population}
        return {
            "search": search,
            "seconds": seconds,
            "threads": self.threads,
            "seed": self.seed,
            **({} if search == "least-squares" else effort),
        }


def timed(work: Callable[[], Identified]) -> tuple[Identified, Row]:
    """Return a fit, and its wall and processor seconds over all threads."""
    wall, cpu = time.perf_counter(), time.process_time()
    found = work()
    return found, {"wall_s": time.perf_counter() - wall, "cpu_s": time.process_time() - cpu}
