"""A study's numbers: per method over twins and seeds, with intervals; nothing is left out.

Twins are drawn from a population and seeds of one twin share it, so that the bootstrap resamples
whole twins. The paper reports its offset with the other sign, command minus actual.
"""

import itertools
import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.evaluate.runner import software_versions
from hopping_leg.evaluate.statistics import median_interval
from hopping_leg.sim_to_real.fitting import Identify
from hopping_leg.sim_to_real.hopping import FIRST_SEED, Hop, disturbance_of
from hopping_leg.sim_to_real.methods import Method
from hopping_leg.sim_to_real.ratio import compare
from hopping_leg.sim_to_real.study import Study
from hopping_leg.sim_to_real.training import Train

Row = dict[str, Any]

_SEED = 0
"""Of the bootstrap."""


def tabulate(
    study: Study, fits: Sequence[Identify], trainings: Sequence[Train], hops: Sequence[Hop]
) -> dict[str, Any]:
    """Return everything that was measured, as JSON values.

    Args:
        study: What was asked for.
        fits: All done.
        trainings: All done.
        hops: All done.
    """
    trials = [row for hop in hops for row in hop.rows()]
    rows = [
        _pooled(method, [r for r in trials if (r["method"], r["command_m"]) == (method.name, c)])
        for method in study.methods
        for c in study.commands
    ]
    return {
        **about(study),
        "training_seeds": list(study.seeds),
        "recipe": study.recipe,
        "recipe_changes": list(study.changes),
        "training_steps": study.steps,
        "rows": rows,
        **_overall(trials, study),
        **_best_in_own_simulation(trials, study),
        "identification": [fit_row(fit) for fit in fits],
        "trainings": [_training(training) for training in trainings],
        "trials": trials,
    }


def _overall(trials: Sequence[Row], study: Study) -> Row:
    """Return one row per method over all commands, and how the others compare with the first."""
    first, *others = study.methods
    return {
        "methods": [_whole(method, trials, study) for method in study.methods],
        "comparison": [compare(first.name, other.name, trials, _SEED) for other in others],
    }


def _best_in_own_simulation(trials: Sequence[Row], study: Study) -> Row:
    """Return the same over the better trainings alone, if there are several of each.

    Of the training seeds of a method and twin, the one counts whose policy scored best in the
    simulation that it was trained in: what someone gets who trains several times and chooses
    without having met the leg.
    """
    if len(study.seeds) == 1:
        return {}
    best = {}
    for method, twin in itertools.product(study.methods, study.twins):
        runs = [Train(study, twin, method, seed) for seed in study.seeds]
        best[method.name, twin.name] = min(runs, key=lambda run: run.own_score).seed
    chosen = [row for row in trials if row["seed"] == best[row["method"], row["twin"]]]
    return {"best_in_own_simulation": _overall(chosen, study)}


def about(study: Study) -> Row:
    """Return what every study's results begin with: the twins and how they were met."""
    return {
        "twins": [
            {
                "name": twin.name,
                "robot_digest": twin.robot.digest,
                "believed": twin.believed,
                "paper_disturbance": disturbance_of(twin.robot).delay_probability > 0,
            }
            for twin in study.twins
        ],
        "recording_seconds": study.seconds,
        "evaluation_seed": FIRST_SEED,
        "evaluation_seeds": study.repeats,
        "versions": software_versions(),
    }


def _pooled(method: Method, trials: Sequence[Row]) -> Row:
    """Return one row over the twins and seeds of a method and command."""
    absolute, signed = (_by_twin(trials, name) for name in ("median_abs_error_m", "median_error_m"))
    low, high = median_interval(absolute, _SEED)
    signed_low, signed_high = median_interval(signed, _SEED)
    return {
        "method": method.name,
        "meaning": method.meaning,
        "command_m": trials[0]["command_m"],
        "policies": len(trials),
        "median_abs_error_m": float(np.median(np.concatenate(absolute))),
        "median_abs_error_low_m": low,
        "median_abs_error_high_m": high,
        "worst_abs_error_m": float(np.max(np.concatenate(absolute))),
        "median_error_m": float(np.median(np.concatenate(signed))),
        "median_error_low_m": signed_low,
        "median_error_high_m": signed_high,
        "median_std_m": float(np.median([r["std_m"] for r in trials if r["hops"]] or [np.nan])),
        "hops": sum(r["hops"] for r in trials),
        "skipped_hops": sum(r["skipped_hops"] for r in trials),
        "body_contacts": sum(r["body_contacts"] for r in trials),
        "motionless": sum(r["motionless"] for r in trials),
    }


def _by_twin(trials: Sequence[Row], name: str) -> list[Array]:
    """Return a number of every seed, one array per twin."""
    twins = dict.fromkeys(r["twin"] for r in trials)
    return [np.array([r[name] for r in trials if r["twin"] == twin]) for twin in twins]


def _whole(method: Method, trials: Sequence[Row], study: Study) -> Row:
    """Return one row over all commands of a method."""
    mine = [r for r in trials if r["method"] == method.name]
    errors = _by_twin(mine, "median_abs_error_m")
    low, high = median_interval(errors, _SEED)
    runs = [
        [r for r in mine if (r["twin"], r["seed"]) == run]
        for run in dict.fromkeys((r["twin"], r["seed"]) for r in mine)
    ]
    by_command = [[r["median_abs_error_m"] for r in mine if r["command_m"] == c]
                  for c in study.commands]  # fmt: skip
    return {
        "method": method.name,
        "meaning": method.meaning,
        "policies": len(runs),
        "median_abs_error_m": float(np.median(np.concatenate(errors))),
        "median_abs_error_low_m": low,
        "median_abs_error_high_m": high,
        "worst_command_median_abs_error_m": max(float(np.median(e)) for e in by_command),
        "worst_abs_error_m": float(np.max(np.concatenate(errors))),
        "ordered": sum(_ordered(run) for run in runs),
        "hops": sum(r["hops"] for r in mine),
        "skipped_hops": sum(r["skipped_hops"] for r in mine),
        "body_contacts": sum(r["body_contacts"] for r in mine),
        "motionless": sum(r["motionless"] for r in mine),
    }


def _ordered(run: Sequence[Row]) -> bool:
    """Return whether a policy's median apex rises from every command to the next."""
    ranked = sorted(run, key=lambda r: float(r["command_m"]))
    apexes = [r["command_m"] + r["median_error_m"] for r in ranked]
    moves = not any(r["motionless"] for r in run)
    return moves and all(low < high for low, high in itertools.pairwise(apexes))


def fit_row(fit: Identify) -> Row:
    """Return how well a fit went: errors on data it has not seen, and its parameters."""
    file = fit.study.fitted(fit.twin, fit.method).with_suffix(".json")
    found = json.loads(file.read_text(encoding="utf-8"))
    before, after = found["start_validation"], found["validation"]
    names = ("closed_loop_position_rms_rad", "closed_loop_torque_rms_nm")
    truth = found["truth"]
    return {
        "method": fit.fit.name,
        "twin": fit.twin.name,
        **{f"{name}_before": before[name] for name in names},
        **{name: after[name] for name in names},
        "parameters": [
            {**{k: p[k] for k in ("name", "unit", "start", "value", "interval_low",
                                  "interval_high", "at_bound")}, "truth": truth.get(p["name"])}
            for p in found["parameters"]
        ],
    }  # fmt: skip


def _training(training: Train) -> Row:
    """Return how a policy hops in the simulation that it was trained in."""
    result = training.result
    errors = [trial["median_error_m"] for trial in result["selected"]["trials"]]
    known = [abs(error) for error in errors if error is not None]
    return {
        "training": training.path.name,
        "minutes": result["minutes"],
        "steps": result["steps"],
        "own_simulation_worst_abs_median_error_m": max(known)
        if len(known) == len(errors)
        else None,
        "own_simulation_score_m": training.own_score,
    }
