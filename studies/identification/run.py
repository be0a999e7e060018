"""All parts of the benchmark in one run, each kept, and what they say about the project's bars."""

import contextlib
import functools
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Self

from rich.console import Console
from rich.table import Table

from hopping_leg.cli.identify import FitProgress
from hopping_leg.cli.options import at_least
from hopping_leg.errors import UsageError, unknown_name
from hopping_leg.identify.result import software_versions
from hopping_leg.identify.search import Report
from hopping_leg.terminal import plain_console
from studies.identification.arm import coverage
from studies.identification.bars import bars
from studies.identification.fits import METHODS
from studies.identification.friction import friction
from studies.identification.mujoco_sysid import mujoco_sysid
from studies.identification.real import real
from studies.identification.study import FitCache, Study
from studies.identification.synthetic import paper_size, synthetic
from studies.identification.throughput import throughput
from studies.shared import host

PARTS = (
    "synthetic",
    "throughput",
    "coverage",
    "mujoco-sysid",
    "paper-size",
    "recordings",
    "friction",
)
"""What can be measured, in order."""

ARM_SECONDS = 12.0
"""Of each recording of an independent arm."""

PAPER_METHODS = ("least-squares", "two-pass")
"""Searches on recordings of the paper's size."""


def bench_identify(
    study: Study,
    cache: FitCache,
    *,
    parts: Sequence[str] = PARTS,
    recordings: Path | None = None,
    on_repeat: Callable[[int, int], None] = lambda done, total: None,
) -> dict[str, Any]:
    """Measure identification.

    Args:
        study: Sizes and efforts.
        cache: Keeps each result.
        parts: Which of ``PARTS``.
        recordings: Folder with real recordings; None leaves them out.
        on_repeat: Called with rounds of the timing, done and in all.

    Returns:
        An entry per part, and ``bars``: what was to be reached and what was.

    Raises:
        UsageError: There is no such part or search, or the folder holds no recordings.
    """
    for kind, given, known in (
        ("part of the benchmark", parts, PARTS),
        ("search", study.searches, tuple(METHODS)),
    ):
        for name in given:
            if name not in known:
                raise UsageError(unknown_name(kind, name, known))
    if "least-squares" not in study.searches and {"synthetic", "mujoco-sysid"} & set(parts):
        raise UsageError("Known twins are always identified by least squares, too; add it.")
    sizes = {field.name: getattr(study, field.name) for field in fields(Study)}
    result: dict[str, Any] = {"study": sizes, "host": host()}
    if "synthetic" in parts or "mujoco-sysid" in parts:
        result["synthetic"] = synthetic(study, cache)
    if "throughput" in parts:
        result["throughput"] = cache.load_or_run(
            "throughput",
            "throughput: replay and plain loop in turn",
            {**study.asked("cma", study.throughput_seconds), "repeats": study.repeats},
            lambda: throughput(study, on_repeat),
        )
    if "coverage" in parts:
        result["coverage"] = cache.load_or_run(
            "coverage",
            "independent arms",
            {"arms": study.arms, "seed": study.seed, "threads": study.threads},
            lambda: coverage(study.arms, ARM_SECONDS, study.seed, study.threads, on_repeat),
        )
    if "mujoco-sysid" in parts:
        result["mujoco_sysid"] = mujoco_sysid(study, cache, result["synthetic"]["rows"])
        result["mujoco_sysid"]["side_by_side"] = _beside(result)
    if "paper-size" in parts:
        result["paper_size"] = {
            "rows": [
                cache.load_or_run(
                    f"paper-size-{method}",
                    f"recordings of the paper's size: {method}",
                    study.asked(method, study.paper_seconds),
                    functools.partial(paper_size, study, cache.report, method),
                )
                for method in PAPER_METHODS
                if method in study.searches
            ]
        }
    if "recordings" in parts and recordings is not None:
        result["recordings"] = real(study, cache, recordings)
    if "friction" in parts and recordings is not None:
        result["friction"] = friction(
            recordings, study.seed, lambda stage: cache.report(stage, 0.0, 0.0)
        )
    return {**result, "bars": bars(result), "versions": software_versions()}


def _beside(result: dict[str, Any]) -> list[dict[str, Any]]:
    """Return our searches and mujoco.sysid's on the same data, in one list."""
    others = result["mujoco_sysid"]["rows"]
    cases = list(dict.fromkeys(row["case"] for row in others))
    rows = [*result["synthetic"]["rows"], *others]
    keys = ("case", "method", "fitted", "worst_error_percent", "wall_s", "cpu_s")
    unseen = ("other_swings_rms_rad", "other_squats_rms_rad")
    return [
        {key: row.get(key) for key in (*keys, *unseen)}
        for case in cases
        for row in rows
        if row["case"] == case
    ]


_VARIABLE = "HOPPING_LEG_RECORDINGS"


@dataclass(frozen=True)
class Identify(Study):
    """Identify known twins and real recordings; compare searches, mujoco.sysid and plain loops.

    Each result is kept; interrupted, the same command goes on with the next.
    """

    parts: tuple[str, ...] = ()
    """Of synthetic, throughput, coverage, mujoco-sysid, paper-size, recordings and friction;
    default: all."""
    recordings: Path | None = None
    """Folder with real recordings; default: the environment's HOPPING_LEG_RECORDINGS, if set."""
    out: Path = Path("runs/bench-identify")
    """Where results are kept; finished parts are not repeated."""
    json: Path | None = None
    """Write every number to this file."""

    def measure(self) -> dict[str, Any]:
        """Run it, print what was to be reached and what was, return every number."""
        at_least(1, generations=self.generations, repeats=self.repeats)
        at_least(1, threads=self.threads, arms=self.arms)
        at_least(4, population=self.population)
        at_least(0, seed=self.seed)
        for name, least in (("seconds", 16), ("throughput_seconds", 12), ("paper_seconds", 12)):
            if not least <= getattr(self, name) <= 3600:
                raise UsageError(
                    f"--{name.replace('_', '-')} is {getattr(self, name):g} but must lie between"
                    f" {least} and 3600."
                )
        console = plain_console()
        with _Progress(console) as progress:
            result = bench_identify(
                self,
                FitCache(self.out, progress.begin, progress.report),
                parts=self.parts or PARTS,
                recordings=self.recordings or _recordings(),
                on_repeat=lambda done, total: console.print(f"{done} of {total}"),
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
