"""Known twins identified: with a fixed base, on the ground, hopping, and as long as the paper's."""

import functools
from typing import Any

from hopping_leg.identify.parameters import LegHypothesis
from hopping_leg.identify.recording import Recording
from hopping_leg.identify.search import Report
from studies.identification.fits import fit, unseen_errors
from studies.identification.study import FitCache, Study
from studies.identification.twin import AIR, GROUND, Motion, believed, record, record_paper

Case = tuple[str, dict[str, float], tuple[Motion, ...], tuple[Motion, ...], tuple[str, ...]]

FIXED = "fixed base"
"""Name of the case with eight parameters."""

RAIL = "fixed base and rail"
"""Name of the case that keeps contact."""

HOPPING = "fixed base, rail and hops"
"""Name of the case that does not."""

CASES: dict[str, Case] = {
    FIXED: (
        "fixed",
        AIR,
        ("swings",),
        ("other swings",),
        ("least-squares", "cma", "two-pass"),
    ),
    RAIL: (
        "rail",
        GROUND,
        ("swings", "squats"),
        ("other swings", "other squats"),
        ("least-squares", "two-pass"),
    ),
    HOPPING: (
        "hopping",
        GROUND,
        ("swings", "squats", "hops"),
        ("other swings", "other squats", "other hops"),
        ("least-squares", "two-pass"),
    ),
}
"""Short name, truth, motions to fit to, motions to judge by, searches."""

BEYOND_TABLE = ("thigh.com", "shank.com")
"""What the paper's search fits beyond its Table I, as these twins differ in it."""


_NOT_JUDGED = {f"other_{motion}_rms_rad": None for motion in ("swings", "squats", "hops")}


def synthetic(study: Study, cache: FitCache) -> dict[str, Any]:
    """Identify each twin with each search.

    Returns:
        ``rows``, a record per case and search, and ``start``, the errors before any fit.
    """
    rows, start = [], []
    for case, (short, truth, fitted, judged, methods) in CASES.items():
        for method in (m for m in methods if m in study.searches):
            asked = {
                **study.asked(method, study.seconds),
                "truth": truth,
                "fitted": fitted,
                "judged": judged,
            }
            row = cache.load_or_run(
                f"synthetic-{short}-{method}",
                f"known twin, {case}: {method}",
                asked,
                functools.partial(identify_twin, study, cache.report, case, method),
            )
            rows.append({"case": case, **_NOT_JUDGED, **row})
        unseen: dict[str, Recording] = {
            motion: record(truth, motion, study.seconds) for motion in judged
        }
        errors = unseen_errors(LegHypothesis(believed()), unseen, study.threads)
        start.append({"case": case, **_NOT_JUDGED, **errors})
    return {"rows": rows, "start": start}


def identify_twin(study: Study, report: Report, case: str, method: str) -> dict[str, Any]:
    """Identify one of ``CASES`` with one search; as ``fits.fit``."""
    _, truth, fitted, judged, _ = CASES[case]
    recordings = [record(truth, motion, study.seconds) for motion in fitted]
    unseen: dict[str, Recording] = {
        motion: record(truth, motion, study.seconds) for motion in judged
    }
    parameters = BEYOND_TABLE if method == "two-pass" else _parameters(case)
    return fit(study, report, method, recordings, unseen, truth, parameters)


def _parameters(case: str) -> tuple[str, ...] | None:
    return tuple(AIR) if case == FIXED else None


def paper_size(study: Study, report: Report, method: str) -> dict[str, Any]:
    """Identify the twin from recordings of the paper's size.

    Args:
        study: Length of the recordings and effort.
        report: Hears of the fit's progress.
        method: How to search.

    Returns:
        As ``fits.fit``, with minutes.
    """
    unseen = {
        motion: record(GROUND, motion, study.seconds)
        for motion in ("other swings", "other squats", "other hops")
    }
    parameters = BEYOND_TABLE if method == "two-pass" else None
    found = fit(
        study, report, method, record_paper(study.paper_seconds), unseen, GROUND, parameters
    )
    return {
        "recorded_s": 2 * study.paper_seconds,
        "wall_minutes": found["wall_s"] / 60,
        "cpu_minutes": found["cpu_s"] / 60,
        **found,
    }
