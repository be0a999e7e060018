"""All parts of the benchmark in one run, each kept, and what they say about the project's bars."""

import functools
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from rich.table import Table

from hopping_leg.cli.identify import FitProgress
from hopping_leg.cli.options import at_least
from hopping_leg.errors import UsageError, unknown_name
from hopping_leg.identify.result import software_versions
from hopping_leg.robot.parameters import JOINTS
from hopping_leg.terminal import plain_console
from studies.identification.arm import coverage
from studies.identification.known import FIXED, HOPPING, METHODS, RAIL, paper_size, synthetic
from studies.identification.real import real
from studies.identification.study import FitCache, Study
from studies.shared import host

PARTS = ("synthetic", "coverage", "paper-size", "recordings")
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
    on_arm: Callable[[int, int], None] = lambda done, total: None,
) -> dict[str, Any]:
    """Measure identification.

    Args:
        study: Sizes and efforts.
        cache: Keeps each result.
        parts: Which of ``PARTS``.
        recordings: Folder with real recordings; None leaves them out.
        on_arm: Called with independent arms done and in all.

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
    if "least-squares" not in study.searches and "synthetic" in parts:
        raise UsageError("Known twins are always identified by least squares, too; add it.")
    sizes = {field.name: getattr(study, field.name) for field in fields(Study)}
    result: dict[str, Any] = {"study": sizes, "host": host()}
    if "synthetic" in parts:
        result["synthetic"] = synthetic(study, cache)
    if "coverage" in parts:
        result["coverage"] = cache.load_or_run(
            "coverage",
            "independent arms",
            {"arms": study.arms, "seed": study.seed, "threads": study.threads},
            lambda: coverage(study.arms, ARM_SECONDS, study.seed, study.threads, on_arm),
        )
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
    return {**result, "bars": bars(result), "versions": software_versions()}


Bar = tuple[str, float, str, float | None]
"""In words, the bar, its unit, and the number."""


def bars(result: dict[str, Any]) -> list[dict[str, Any]]:
    """Return a record per bar that was measured: what, the bar, the number, whether it is reached.

    Args:
        result: Of the benchmark, by part.
    """
    found = [*_known(result), *_real(result)]
    if (arms := result.get("coverage")) is not None:
        share, longest = 100 * arms["share_inside"], arms["fit_longest_s"]
        found.append(("independent arms: 95 % intervals that hold the truth", 90.0, "%", share))
        found.append(("independent arms, 12 s each: longest fit", 10.0, "s", longest))
    for row in result.get("paper_size", {}).get("rows", []):
        what = f"{row['recorded_s']:g} s of recordings: {row['method']}"
        found.append((what, 90.0, "s", 60 * row["wall_minutes"]))
    return [
        {
            "what": what,
            "bar": bar,
            "unit": unit,
            "measured": value,
            "reached": value is not None and (value >= bar if "hold" in what else value <= bar),
        }
        for what, bar, unit, value in found
    ]


def _known(result: dict[str, Any]) -> list[Bar]:
    every = result.get("synthetic", {}).get("rows", [])
    rows = {row["case"]: row for row in every if row["method"] == METHODS["least-squares"]}
    if not rows:
        return []
    fixed, rail, hops = rows[FIXED], rows[RAIL], rows[HOPPING]
    error = fixed["worst_identifiable_error_percent"]
    return [
        ("known twin, fixed base: identifiable parameters", 0.5, "%", error),
        ("known twin, fixed base: time", 10.0, "s", fixed["wall_s"]),
        ("known twin: unseen swings", 1.0, "mrad", 1e3 * rail["other_swings_rms_rad"]),
        ("known twin: unseen squats", 3.0, "mrad", 1e3 * rail["other_squats_rms_rad"]),
        ("known twin: unseen hops", 10.0, "mrad", 1e3 * hops["other_hops_rms_rad"]),
    ]


def _real(result: dict[str, Any]) -> list[Bar]:
    """Return bars of real recordings against the worst of all splits."""
    arms, ahead = ("joint 1", "joint 2"), "double pendulum, {} s ahead, {}, worst split"
    kinds: list[tuple[str, str, str, Sequence[str], str, float, tuple[float, float]]] = [
        ("double", "predicted_0_2_s_rms_rad", ahead, arms, "mrad", 1e3, (12.0, 29.0)),
        ("double", "predicted_0_5_s_rms_rad", ahead, arms, "mrad", 1e3, (33.0, 95.0)),
    ]
    leg = "leg V2, {}, {}, worst split"
    kinds += [
        ("leg V2", "closed_loop_position_rms_rad", leg, JOINTS, "mrad", 1e3, (25.0, 3.0)),
        ("leg V2", "closed_loop_torque_rms_nm", leg, JOINTS, "N m", 1.0, (0.14, 0.4)),
    ]
    found: list[Bar] = []
    for rig, key, what, names, unit, factor, pair in kinds:
        every = result.get("recordings", {}).get("rows", [])
        rows = [row[key] for row in every if row["rig"].startswith(rig)]
        about = ".".join(key.split("_")[1:3]) if rig == "double" else key.split("_")[2]
        for joint, (name, bar) in enumerate(zip(names, pair, strict=True)):
            values = [row[joint] for row in rows if row[joint] is not None]
            if values:
                found.append((what.format(about, name), bar, unit, factor * max(values)))
    return found


_VARIABLE = "HOPPING_LEG_RECORDINGS"


@dataclass(frozen=True)
class Identify(Study):
    """Identify known twins, independent arms and real recordings; compare searches.

    Each result is kept; interrupted, the same command goes on with the next.
    """

    parts: tuple[str, ...] = ()
    """Of synthetic, coverage, paper-size and recordings; default: all."""
    recordings: Path | None = None
    """Folder with real recordings; default: the environment's HOPPING_LEG_RECORDINGS, if set."""
    out: Path = Path("runs/bench-identify")
    """Where results are kept; finished parts are not repeated."""
    json: Path | None = None
    """Write every number to this file."""

    def measure(self) -> dict[str, Any]:
        """Run it, print what was to be reached and what was, return every number."""
        at_least(1, generations=self.generations, threads=self.threads, arms=self.arms)
        at_least(4, population=self.population)
        at_least(0, seed=self.seed)
        for name, least in (("seconds", 16), ("paper_seconds", 12)):
            if not least <= getattr(self, name) <= 3600:
                raise UsageError(
                    f"--{name.replace('_', '-')} is {getattr(self, name):g} but must lie between"
                    f" {least} and 3600."
                )
        console, named = plain_console(), os.environ.get(_VARIABLE)
        with FitProgress() as progress:
            result = bench_identify(
                self,
                FitCache(self.out, lambda words: console.print(f"{words} ..."), progress.update),
                parts=self.parts or PARTS,
                recordings=self.recordings or (Path(named) if named else None),
                on_arm=lambda done, total: progress.update("arms", done / total, 0.0),
            )
        table = Table("what", "bar", "measured", "unit", "reached")
        for row in result["bars"]:
            measured = "-" if row["measured"] is None else f"{row['measured']:.3g}"
            reached = "yes" if row["reached"] else "no"
            table.add_row(row["what"], f"{row['bar']:g}", measured, row["unit"], reached)
        console.print(table)
        return result
