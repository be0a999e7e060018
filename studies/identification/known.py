"""Known twins identified: with a fixed base, on the ground, hopping, and as long as the paper's."""

from collections.abc import Mapping, Sequence

import numpy as np

from hopping_leg.identify.optimizers import SearchOptions
from hopping_leg.identify.parameters import LegHypothesis
from hopping_leg.identify.pipeline import IdentifyOptions, identify
from hopping_leg.identify.recording import Recording
from hopping_leg.identify.validation import validate
from studies.identification.study import Study, timed
from studies.identification.twin import AIR, GROUND, Motion, believed, record, record_paper
from studies.shared import Row

METHODS = {
    "least-squares": "least squares",
    "cma": "CMA-ES on the same errors",
    "two-pass": "CMA-ES in two passes, as the paper",
}
FIXED, RAIL, HOPPING = "fixed base", "fixed base and rail", "fixed base, rail and hops"
"""Names of the cases: eight parameters, also the ground's, and without steady contact."""

Case = tuple[str, dict[str, float], tuple[Motion, ...], tuple[str, ...]]
CASES: dict[str, Case] = {
    FIXED: ("fixed", AIR, ("swings",), ("least-squares", "cma", "two-pass")),
    RAIL: ("rail", GROUND, ("swings", "squats"), ("least-squares", "two-pass")),
    HOPPING: ("hopping", GROUND, ("swings", "squats", "hops"), ("least-squares", "two-pass")),
}
"""Short name, truth, motions to fit to (others like them judge), searches."""

BEYOND_TABLE = ("thigh.com", "shank.com")
"""What the paper's search fits beyond its Table I, as these twins differ in it."""

_OTHER: dict[Motion, Motion] = {
    "swings": "other swings",
    "squats": "other squats",
    "hops": "other hops",
}
_NOT_JUDGED = {f"other_{motion}_rms_rad": None for motion in _OTHER}


def synthetic(study: Study) -> Row:
    """Identify each twin with each search.

    Returns:
        ``rows``, a record per case and search, and ``start``, the errors before any fit.
    """
    rows, start = [], []
    for case, (short, truth, fitted, methods) in CASES.items():
        for method in (m for m in methods if m in study.searches):
            asked = {**study.asked(method, study.seconds), "truth": truth, "fitted": fitted}
            row = study.once(f"synthetic-{short}-{method}", asked, identify_twin, case, method)
            rows.append({"case": case, **_NOT_JUDGED, **row})
        unseen = _unseen(study, truth, fitted)
        errors = unseen_errors(LegHypothesis(believed()), unseen, study.threads)
        start.append({"case": case, **_NOT_JUDGED, **errors})
    return {"rows": rows, "start": start}


def _unseen(
    study: Study, truth: dict[str, float], motions: Sequence[Motion]
) -> dict[Motion, Recording]:
    return {_OTHER[m]: record(truth, _OTHER[m], study.seconds) for m in motions}


def identify_twin(study: Study, case: str, method: str) -> Row:
    """Identify one of ``CASES`` with one search; as ``fit``."""
    _, truth, fitted, _ = CASES[case]
    parameters = tuple(AIR) if case == FIXED else None
    recordings = [record(truth, motion, study.seconds) for motion in fitted]
    return fit(study, method, recordings, _unseen(study, truth, fitted), truth, parameters)


def paper_size(study: Study, method: str) -> Row:
    """Identify the twin from recordings of the paper's size; as ``fit``, with minutes."""
    recordings, unseen = record_paper(study.paper_seconds), _unseen(study, GROUND, tuple(_OTHER))
    found = fit(study, method, recordings, unseen, GROUND)
    minutes = {f"{kind}_minutes": found[f"{kind}_s"] / 60 for kind in ("wall", "cpu")}
    return {"recorded_s": 2 * study.paper_seconds, **minutes, **found}


def fit(
    study: Study,
    method: str,
    recordings: Sequence[Recording],
    unseen: Mapping[Motion, Recording],
    truth: Mapping[str, float],
    parameters: tuple[str, ...] | None = None,
) -> Row:
    """Identify a known twin by one of ``METHODS`` and compare with the truth.

    ``unseen`` recordings judge the fit, ``truth`` is what differs from where it begins; without
    parameters the plan decides what is fitted. The paper's search fits ``BEYOND_TABLE``.
    """
    if method == "two-pass":
        parameters = BEYOND_TABLE
    effort = SearchOptions(generations=study.generations, population=study.population)
    options = IdentifyOptions(parameters, search=method, effort=effort, threads=study.threads)
    judges = list(unseen.values())
    identified, took = timed(
        lambda: identify(recordings, believed(), validate=judges, options=options, seed=study.seed)
    )
    known = identified.identifiability
    told = [n for n in known.names if not any(f"'{n}'" in s for s in known.statements)]
    rows = compare(dict(zip(known.names, known.values.tolist(), strict=True)), truth, told)
    for row, searched in zip(rows, identified.passes[-1].parameters.parameters, strict=True):
        row |= {"low": searched.low, "high": searched.high}
    return {
        "method": METHODS[method],
        **summary(rows),
        **unseen_errors(identified.hypothesis, unseen, study.threads),
        **took,
        "candidates": sum(one.found.evaluations for one in identified.passes),
        "cost": identified.passes[-1].found.cost,
        "parameters": rows,
        "cannot_tell": known.statements,
    }


def compare(
    values: Mapping[str, float], truth: Mapping[str, float], told: Sequence[str]
) -> list[Row]:
    """Return a record per parameter that was fitted, and whether the fit claims to tell it."""
    start = LegHypothesis(believed())
    rows = []
    for name, value in values.items():
        true = truth.get(name, start.get(name))
        error = 100 * (value / true - 1) if true else None
        row = {"name": name, "start": start.get(name), "truth": true, "value": value}
        rows.append({**row, "error_percent": error, "identifiable": name in told})
    return rows


def summary(rows: Sequence[Row]) -> Row:
    """Return how many parameters were fitted and told, and the worst relative errors."""

    def worst(chosen: Sequence[Row]) -> float | None:
        errors = [abs(r["error_percent"]) for r in chosen if r["error_percent"] is not None]
        return max(errors, default=None)

    told = [row for row in rows if row["identifiable"]]
    return {
        "fitted": len(rows),
        "identifiable": len(told),
        "worst_identifiable_error_percent": worst(told),
        "worst_error_percent": worst(rows),
    }


def unseen_errors(
    candidate: LegHypothesis, unseen: Mapping[Motion, Recording], threads: int
) -> Row:
    """Return the rms error of joint positions in closed loop on each recording, rad."""
    found = {}
    for name, recording in unseen.items():
        pair = validate([recording], candidate, threads).closed_loop_position_rms_rad
        found[f"{name.replace(' ', '_')}_rms_rad"] = float(np.max(pair))
    return found
