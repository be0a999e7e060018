"""One fit of a known twin, judged: parameters against the truth, prediction on unseen data."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hopping_leg.identify.optimizers import CmaOptions
from hopping_leg.identify.parameters import LegHypothesis
from hopping_leg.identify.pipeline import IdentifyOptions, identify
from hopping_leg.identify.recording import Recording
from hopping_leg.identify.search import Report, SearchOptions
from hopping_leg.identify.validation import validate
from hopping_leg.robot.model import COARSE_TIMESTEP
from studies.identification.study import Clock, Study
from studies.identification.twin import believed

METHODS = {
    "least-squares": "least squares",
    "cma": "CMA-ES on the same errors",
    "two-pass": "CMA-ES in two passes, as the paper",
}


def fit(
    study: Study,
    report: Report,
    method: str,
    recordings: Sequence[Recording],
    unseen: Mapping[str, Recording],
    truth: Mapping[str, float],
    parameters: tuple[str, ...] | None,
) -> dict[str, Any]:
    """Identify a known twin and compare with the truth.

    Args:
        study: Efforts.
        report: Hears of the fit's progress.
        method: One of ``METHODS``.
        recordings: To fit to.
        unseen: To judge by, by what is written of them.
        truth: What differs from where the fit begins.
        parameters: What to fit; None lets the plan decide.
    """
    options = IdentifyOptions(
        parameters=parameters,
        search=method,
        effort=SearchOptions(cma=CmaOptions(study.generations, study.population)),
        threads=study.threads,
    )
    with Clock() as clock:
        identified = identify(
            recordings,
            believed(),
            validate=list(unseen.values()),
            options=options,
            seed=study.seed,
            report=report,
        )
    said = identified.identifiability.statements
    told = [
        n
        for n in identified.identifiability.names
        if not any(f"'{n}'" in sentence for sentence in said)
    ]
    values = dict(
        zip(
            identified.identifiability.names,
            identified.identifiability.values.tolist(),
            strict=True,
        )
    )
    rows = compare(values, truth, told)
    for row, searched in zip(rows, identified.passes[-1].parameters.parameters, strict=True):
        row |= {"low": searched.low, "high": searched.high}
    return {
        "method": METHODS[method],
        **summary(rows),
        **unseen_errors(identified.hypothesis, unseen, study.threads),
        "wall_s": clock.wall,
        "cpu_s": clock.cpu,
        "candidates": sum(one.found.evaluations for one in identified.passes),
        "cost": identified.passes[-1].found.cost,
        "parameters": rows,
        "cannot_tell": said,
    }


def compare(
    values: Mapping[str, float], truth: Mapping[str, float], told: Sequence[str] | None
) -> list[dict[str, Any]]:
    """Return a record per parameter: its value, the truth, and the relative error.

    Args:
        values: What a fit found.
        truth: What differs from where the fit began.
        told: Which ones the fit claims to tell; None if it makes no claims.
    """
    start = LegHypothesis(believed())
    rows = []
    for name, value in values.items():
        true = truth.get(name, start.get(name))
        rows.append(
            {
                "name": name,
                "start": start.get(name),
                "truth": true,
                "value": value,
                "error_percent": 100 * (value / true - 1) if true else None,
                "identifiable": None if told is None else name in told,
            }
        )
    return rows


def summary(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return how many parameters were fitted and told, and the worst relative errors."""

    def worst(chosen: Sequence[dict[str, Any]]) -> float | None:
        errors = [abs(r["error_percent"]) for r in chosen if r["error_percent"] is not None]
        return max(errors, default=None)

    told = [row for row in rows if row["identifiable"]]
    claims = any(row["identifiable"] is not None for row in rows)
    return {
        "fitted": len(rows),
        "identifiable": len(told) if claims else None,
        "worst_identifiable_error_percent": worst(told),
        "worst_error_percent": worst(rows),
    }


def unseen_errors(
    candidate: LegHypothesis, unseen: Mapping[str, Recording], threads: int
) -> dict[str, Any]:
    """Return the rms error of joint positions in closed loop on each recording, rad."""
    found = {}
    for name, recording in unseen.items():
        pair = validate([recording], candidate, COARSE_TIMESTEP, threads).closed_loop_position
        found[f"{name.replace(' ', '_')}_rms_rad"] = float(np.max(pair))
    return found
