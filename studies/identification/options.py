"""Benchmark of identification."""

import contextlib
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from rich.console import Console
from rich.table import Table

from hopping_leg.cli.identify import FitProgress
from hopping_leg.cli.options import at_least
from hopping_leg.errors import UsageError
from hopping_leg.identify.search import Report

_VARIABLE = "HOPPING_LEG_RECORDINGS"


@dataclass(frozen=True)
class Identify:
    """Identify known twins and real recordings; compare searches, mujoco.sysid and plain loops.

    Each result is kept; interrupted, the same command goes on.
    """

    parts: tuple[str, ...] = ()
    """Of synthetic, throughput, mujoco-sysid, paper-size and recordings; default: all."""
    skip_paper_size: bool = False
    """Leave out the recordings of the paper's size, which take longest."""
    searches: tuple[str, ...] = ("least-squares", "cma", "two-pass")
    """Of known twins and of recordings of the paper's size."""
    recordings: Path | None = None
    """Folder with real recordings; default: the environment's HOPPING_LEG_RECORDINGS, if set."""
    seconds: float = 16.0
    """Of each recording of a known twin."""
    generations: int = 100
    """Of CMA-ES, in each pass."""
    population: int = 16
    """Candidates of a generation."""
    repeats: int = 5
    """Rounds of the timing."""
    throughput_seconds: float = 240.0
    """Of each recording that is timed; the paper's are of 240 s."""
    paper_seconds: float = 240.0
    """Of each recording of the paper's size."""
    threads: int = 2
    """Of the fits; results do not depend on it."""
    seed: int = 0
    """Of CMA-ES."""
    out: Path = Path("runs/bench-identify")
    """Where results are kept; finished parts are not repeated, killed fits go on."""
    json: Path | None = None
    """Write every number to this file."""

    def measure(self) -> dict[str, Any]:
        """Run it, print what was to be reached and what was, return every number."""
        from studies.identification.run import PARTS, bench_identify
        from studies.identification.study import FitCache, Study

        at_least(1, generations=self.generations, repeats=self.repeats, threads=self.threads)
        at_least(4, population=self.population)
        at_least(0, seed=self.seed)
        for name, least in (("seconds", 16), ("throughput_seconds", 12), ("paper_seconds", 12)):
            if not least <= getattr(self, name) <= 3600:
                raise UsageError(
                    f"--{name.replace('_', '-')} is {getattr(self, name):g} but must lie between"
                    f" {least} and 3600."
                )
        study = Study(
            self.seconds,
            self.generations,
            self.population,
            self.repeats,
            self.throughput_seconds,
            self.paper_seconds,
            self.threads,
            self.seed,
            self.searches,
        )
        left_out = {"paper-size"} if self.skip_paper_size else set()
        console = Console()
        with _Progress(console) as progress:
            result = bench_identify(
                study,
                FitCache(self.out, progress.begin, progress.report),
                parts=self.parts or [part for part in PARTS if part not in left_out],
                recordings=self.recordings or _recordings(),
                on_repeat=lambda done, total: console.print(f"round {done} of {total}"),
            )
        _print(console, result)
        return result


class _Progress:
    """One fit after the other, each with its own bar."""

    def __init__(self, console: Console) -> None:
        self._console, self._bar = console, contextlib.ExitStack()
        self._update: Report = lambda stage, share, cost: None

    def begin(self, words: str) -> None:
        """End the last fit's bar and say what begins."""
        self._bar.close()
        self._console.print(f"{words} ...")
        fit = self._bar.enter_context(FitProgress())
        self._update = fit.update

    def report(self, stage: str, share: float, cost: float) -> None:
        """Show how the present fit goes."""
        self._update(stage, share, cost)

    def __enter__(self) -> Self:
        """Begin without a fit."""
        return self

    def __exit__(self, *_: object) -> None:
        """End the last fit's bar."""
        self._bar.close()


def _recordings() -> Path | None:
    named = os.environ.get(_VARIABLE)
    return Path(named) if named else None


def _print(console: Console, result: dict[str, Any]) -> None:
    table = Table("what", "bar", "measured", "unit", "reached")
    for row in result["bars"]:
        measured = "-" if row["measured"] is None else f"{row['measured']:.3g}"
        reached = "yes" if row["reached"] else "no"
        table.add_row(row["what"], f"{row['bar']:g}", measured, row["unit"], reached)
    console.print(table)
    missing = result.get("mujoco_sysid", {}).get("missing")
    if missing:
        console.print(missing)
