"""A sim-to-real study and its numbers: per method over twins and seeds, with intervals."""

import itertools
import json
from collections.abc import Iterable, Sequence
from typing import Any, TypeVar

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.evaluate import runner, statistics
from hopping_leg.sim_to_real import jobs, methods, stages
from hopping_leg.sim_to_real.study import Study, TwinFile

J = TypeVar("J", bound=jobs.Job)


def transfer(study: Study, at_once: int = 1, afterwards: float = 0.0) -> dict[str, Any]:
    """Run a study, or what is left of it, and return its numbers.

    What the caller does ``afterwards``, s of a core, counts in the time left.

    Raises:
        UsageError: The folder holds results of other options, or there is no such recipe.
    """
    for training in trainings(study):
        training.recipe()
    rounds = (records(study), fits(study), trainings(study), hops(study))
    work_through(rounds, at_once, afterwards)
    return tabulate(study, fits(study), trainings(study), hops(study))


def work_through(
    rounds: Sequence[Sequence[jobs.Job]], at_once: int, afterwards: float = 0.0
) -> None:
    """Do what is not done of some stages, one stage after the other."""
    total = afterwards + sum(job.weight for stage in rounds for job in stage)
    with jobs.Board(total, at_once, own_bars=at_once == 1) as board:
        for stage in rounds:
            jobs.work(stage, at_once, board)


def records(study: Study) -> list[stages.RecordTwin]:
    """Return the recordings that the methods need."""
    rigs = {rig for method in study.methods if method.fit for rig in method.fit.rigs}
    return [stages.RecordTwin(study, twin, rig) for twin in study.twins for rig in sorted(rigs)]


def fits(study: Study) -> list[stages.IdentifyTwin]:
    """Return all identifications, those of the first method first; several may share one."""
    every = (stages.IdentifyTwin(study, t, m) for m in study.methods if m.fit for t in study.twins)
    return list({study.fitted(fit.twin, fit.method): fit for fit in every}.values())


def trainings(study: Study) -> list[stages.TrainPolicy]:
    """Return all trainings; several twins may share one."""
    every = (stages.TrainPolicy(study, t, m, s) for s, m, t in _all(study) if not m.controller)
    return list({train.path: train for train in every}.values())


def hops(study: Study) -> list[stages.HopOnTwin]:
    """Return all trials; what is not trained has one for each twin."""
    return [
        stages.HopOnTwin(study, t, m, s)
        for s, m, t in _all(study)
        if not m.controller or s == study.seeds[0]
    ]


def _all(study: Study) -> Iterable[tuple[int, methods.Method, TwinFile]]:
    return ((s, m, t) for s in study.seeds for m in study.methods for t in study.twins)


Row = dict[str, Any]

_SEED = 0
"""Seed of the bootstrap."""


def tabulate(
    study: Study,
    fits: Sequence[stages.IdentifyTwin],
    trainings: Sequence[stages.TrainPolicy],
    hops: Sequence[stages.HopOnTwin],
) -> dict[str, Any]:
    """Return everything that was measured, as JSON values; all jobs must be done."""
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
        "notes": statistics.twins_note(len(study.twins)),
    }


def _overall(trials: Sequence[Row], study: Study) -> Row:
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
        if method.controller:
            best[method.name, twin.name] = study.seeds[0]
            continue
        runs = [stages.TrainPolicy(study, twin, method, seed) for seed in study.seeds]
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
                "paper_disturbance": stages.disturbance_of(twin.robot).delay_probability > 0,
            }
            for twin in study.twins
        ],
        "recording_seconds": study.seconds,
        "evaluation_seed": stages.FIRST_SEED,
        "evaluation_seeds": study.repeats,
        "versions": runner.software_versions(),
    }


def _pooled(method: methods.Method, trials: Sequence[Row]) -> Row:
    return {
        "method": method.name,
        "meaning": method.meaning,
        "command_m": trials[0]["command_m"],
        "policies": len(trials),
        **_median(trials, "median_abs_error_m"),
        **_median(trials, "median_error_m"),
        "worst_abs_error_m": max(r["median_abs_error_m"] for r in trials),
        "median_std_m": float(np.median([r["std_m"] for r in trials if r["hops"]] or [np.nan])),
        **_sums(trials),
    }


def _median(trials: Sequence[Row], name: str) -> Row:
    """Return the median of a number and its interval over the twins."""
    numbers = _by_twin(trials, name)
    low, high = statistics.median_interval(numbers, _SEED, statistics.LEAST_TWINS)
    start = name.removesuffix("_m")
    median = float(np.median(np.concatenate(numbers)))
    return {name: median, f"{start}_low_m": low, f"{start}_high_m": high}


def _sums(trials: Sequence[Row]) -> Row:
    names = ("hops", "skipped_hops", "missed_runs", "body_contacts", "motionless")
    return {name: sum(r[name] for r in trials) for name in names}


def _loads(trials: Sequence[Row]) -> Row:
    """Return the medians of what hopping asks of the motors and of the soft limits."""
    names = ("outside_limits_fraction", "soft_limit_share", "rated_torque_share",
             "mean_electrical_power_w", "peak_regeneration_w", "torque_reversals_hz")  # fmt: skip
    return {name: float(np.median([r[name] for r in trials])) for name in names}


def _by_twin(trials: Sequence[Row], name: str) -> list[Array]:
    """Return a number of every seed, one array per twin."""
    twins = dict.fromkeys(r["twin"] for r in trials)
    return [np.array([r[name] for r in trials if r["twin"] == twin]) for twin in twins]


def _whole(method: methods.Method, trials: Sequence[Row], study: Study) -> Row:
    mine = [r for r in trials if r["method"] == method.name]
    runs: dict[tuple[str, int], list[Row]] = {}
    for row in mine:
        runs.setdefault((row["twin"], row["seed"]), []).append(row)
    return {
        "method": method.name,
        "meaning": method.meaning,
        "policies": len(runs),
        **_median(mine, "median_abs_error_m"),
        "worst_command_median_abs_error_m": max(
            _at(mine, method.name, command) for command in study.commands
        ),
        "worst_abs_error_m": max(r["median_abs_error_m"] for r in mine),
        "ordered": sum(map(_ordered, runs.values())),
        **_loads(mine),
        **_sums(mine),
    }


def _ordered(run: Sequence[Row]) -> bool:
    """Return whether a policy's median apex rises from every command to the next."""
    ranked = sorted(run, key=lambda r: float(r["command_m"]))
    apexes = [r["command_m"] + r["median_error_m"] for r in ranked]
    moves = not any(r["motionless"] for r in run)
    return moves and all(low < high for low, high in itertools.pairwise(apexes))


def fit_row(fit: stages.IdentifyTwin) -> Row:
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


def _training(training: stages.TrainPolicy) -> Row:
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


def compare(first: str, other: str, trials: Sequence[dict[str, Any]], seed: int) -> dict[str, Any]:
    """Return the ratio of two methods' errors, overall and at the command where it is smallest.

    Trials are one row per method, twin, seed and command. The medians are over all of them; the
    interval resamples whole twins, so that both methods keep meeting the same ones; it is NaN with
    fewer than ``LEAST_TWINS``.
    """
    count = len({row["twin"] for row in trials})
    errors = {
        name: _by_twin([row for row in trials if row["method"] == name], "median_abs_error_m")
        for name in (first, other)
    }

    def ratio(index: Sequence[int]) -> float:
        above, below = (
            np.median(np.concatenate([errors[method][i] for i in index]))
            for method in (other, first)
        )
        return float(above / below)

    low, high = statistics.bootstrap(range(count), ratio, seed, statistics.LEAST_TWINS)
    return {
        "method": other,
        "over": first,
        "ratio": ratio(range(count)),
        "ratio_low": float(low),
        "ratio_high": float(high),
        "least_ratio_of_a_command": min(
            _at(trials, other, c) / _at(trials, first, c)
            for c in dict.fromkeys(row["command_m"] for row in trials)
        ),
    }


def _at(trials: Sequence[dict[str, Any]], method: str, command: float) -> float:
    rows = [row for row in trials if (row["method"], row["command_m"]) == (method, command)]
    return float(np.median([row["median_abs_error_m"] for row in rows]))
