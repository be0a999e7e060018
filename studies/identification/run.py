"""All parts of the benchmark in one run, each kept, and what they say about the project's bars."""

import functools
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from hopping_leg.errors import UsageError, unknown_name
from hopping_leg.identify.result import software_versions
from studies.identification.bars import bars
from studies.identification.fits import METHODS
from studies.identification.mujoco_sysid import mujoco_sysid
from studies.identification.paper_size import paper_size
from studies.identification.real import real
from studies.identification.study import FitCache, Study
from studies.identification.synthetic import synthetic
from studies.identification.throughput import throughput
from studies.timing import host

PARTS = ("synthetic", "throughput", "mujoco-sysid", "paper-size", "recordings")
"""What can be measured, in order."""

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
        cache: Keeps each result, so that a killed benchmark goes on.
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
    result: dict[str, Any] = {"study": asdict(study), "host": host()}
    if "synthetic" in parts or "mujoco-sysid" in parts:
        result["synthetic"] = synthetic(study, cache)
    if "throughput" in parts:
        result["throughput"] = cache.load_or_run(
            "throughput",
            "throughput: batch and plain loops in turn",
            {**study.asked("cma", study.throughput_seconds), "repeats": study.repeats},
            lambda: throughput(study, on_repeat),
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
                    functools.partial(paper_size, study, cache, method),
                )
                for method in PAPER_METHODS
                if method in study.searches
            ]
        }
    if "recordings" in parts and recordings is not None:
        result["recordings"] = real(study, cache, recordings)
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
