"""Recorded runs measured, pooled and turned into the tables of an evaluation."""

import itertools
from collections.abc import Sequence

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.evaluate import metrics, motor_load, statistics, trials
from hopping_leg.evaluate.result import Evaluation, Group, Staircase, Summary
from hopping_leg.robot import Robot


def tabulate(
    runs: Sequence[trials.Run], controllers: Sequence[str], seed: int, robot: Robot | None = None
) -> Evaluation:
    """Measure runs and arrange the numbers; conditions, versions and notes stay empty.

    Args:
        runs: Runs of all controllers.
        controllers: Their names in the order of the rows.
        seed: Seed of the bootstrap.
        robot: The leg of all runs; without it nothing is told of its motors.
    """
    own = {name: [run for run in runs if run.controller == name] for name in controllers}
    measured = {
        name: [(run, window) for run in own[name] for window in metrics.measure(run.trace)]
        for name in controllers
    }

    def windows(name: str, *kinds: str) -> dict[float, list[metrics.HopWindow]]:
        """Return a controller's windows in trials of some kinds, by rising command."""
        found = [w for kind in kinds for run, w in measured[name] if run.trial.kind == kind]
        commands = sorted({w.command for w in found})
        return {c: [w for w in found if w.command == c] for c in commands}

    def rows(*kinds: str) -> list[Summary]:
        return [
            summarise(name, command, group, seed, robot)
            for name in controllers
            for command, group in windows(name, *kinds).items()
        ]

    stairs = {n: [run for run in own[n] if run.trial.kind == "staircase"] for n in controllers}
    return Evaluation(
        summary=rows("fixed", "sequence"),
        sequence=rows("sequence"),
        ladder=rows("ladder"),
        staircase=[_staircase(name, found) for name, found in stairs.items() if found],
        neighbours=[
            {"controller": name, "neighbours": _compare(measured[name], seed)}
            for name in controllers
        ],
        distributions=[
            {
                "controller": name,
                "command_m": command,
                "apexes_m": np.round(metrics.pooled_apexes(group), 5).tolist(),
            }
            for name in controllers
            for command, group in windows(name, "fixed", "sequence").items()
        ],
        estimators=[
            found
            for name in controllers
            if (found := metrics.judge_estimator(name, [run.trace for run in own[name]]))
        ],
    )


def _compare(
    measured: Sequence[tuple[trials.Run, metrics.HopWindow]], seed: int
) -> list[statistics.Neighbours]:
    """Compare neighbouring commands: within a run that has both, or of runs of equal number."""
    apexes: dict[float, dict[tuple[str, int], Array]] = {}
    for run, window in measured:
        if run.trial.kind in ("fixed", "sequence"):
            key, found = (run.trial.kind, run.repeat), apexes.setdefault(window.command, {})
            found[key] = np.concatenate([found.get(key, np.empty(0)), window.apex])
    rows = []
    for low, high in itertools.pairwise(sorted(apexes)):
        pairs = [key for key in apexes[low] if key in apexes[high]]
        lower, upper = ([apexes[command][key] for key in pairs] for command in (low, high))
        rows.append(statistics.compare(low, lower, high, upper, seed))
    return rows


def _staircase(label: str, runs: Sequence[trials.Run]) -> Staircase:
    measured = [metrics.measure(run.trace) for run in runs]
    steps = [list(group) for group in zip(*measured, strict=True)]
    commands = [step[0].command for step in steps]
    errors = [np.median(np.concatenate(metrics.errors_of(step))) for step in steps]
    medians, hopped = np.add(commands, errors), all(len(metrics.pooled_apexes(s)) for s in steps)
    per_run = np.array([[statistics.of(np.median, w.apex) for w in run] for run in measured])
    return Staircase(
        controller=label,
        commands_m=commands,
        median_apexes_m=medians.tolist(),
        monotone=bool((np.diff(medians) > 0).all() and hopped),
        monotone_runs=int((np.diff(per_run, axis=1) > 0).all(axis=1).sum()),
        runs=len(runs),
        skipped_hops=sum(metrics.skipped_in_run(run.trace) for run in runs),
    )


def summarise(
    controller: str,
    command: float,
    windows: Sequence[metrics.HopWindow],
    seed: int,
    robot: Robot | None = None,
) -> Summary:
    """Pool all windows of one controller at one command; the seed is of the bootstrap."""
    parts = [w.part for w in windows]
    load = motor_load.motor_load(parts, robot) if robot else motor_load.unknown()
    apex, errors = metrics.pooled_apexes(windows), metrics.errors_of(windows)
    every = np.concatenate(errors)
    low, high = statistics.bootstrap(errors, _centre, seed)
    spread = statistics.bootstrap([w.apex for w in windows if len(w.apex)], _spread, seed)
    settled = sum(w.settled for w in windows)
    per_second = 1 / settled if settled else float("nan")
    quartiles = np.percentile(apex, [25, 75]) if len(apex) else np.full(2, np.nan)
    peak = np.max([w.peak_torque for w in windows], axis=0)
    return Summary(
        controller=controller,
        robot=str(parts[0].header.get("robot", "")),
        command_m=command,
        median_error_m=float(np.median(every)),
        median_error_low_m=float(low[0]),
        median_error_high_m=float(high[0]),
        median_abs_error_m=float(np.median(np.abs(every))),
        mean_abs_error_m=float(np.abs(every).mean()),
        mean_abs_error_low_m=float(low[1]),
        mean_abs_error_high_m=float(high[1]),
        std_m=statistics.of(np.std, apex),
        std_low_m=float(spread[0]),
        std_high_m=float(spread[1]),
        iqr_m=float(quartiles[1] - quartiles[0]),
        hops=len(apex),
        skipped_hops=sum(w.skipped for w in windows),
        stance_bounces=sum(w.bounces for w in windows),
        hop_rate_hz=len(apex) * per_second,
        flight_fraction=sum(w.flight for w in windows) * per_second,
        min_base_height_m=min(w.min_height for w in windows),
        max_sink_m=max(w.max_sink for w in windows),
        body_contacts=sum(w.body_contacts for w in windows),
        base_contacts=sum(w.base_contacts for w in windows),
        knee_contacts=sum(w.knee_contacts for w in windows),
        peak_hip_torque_nm=float(peak[0]),
        peak_knee_torque_nm=float(peak[1]),
        measured_s=settled,
        runs=len(windows),
        missed_runs=sum(not len(w.apex) for w in windows),
        **vars(load),
    )


def _centre(errors: list[Array]) -> tuple[float, float]:
    """Return median and mean distance, m, of some runs' errors."""
    every = np.concatenate(errors)
    return float(np.median(every)), float(np.abs(every).mean())


def _spread(apexes: list[Array]) -> float:
    return statistics.of(np.std, np.concatenate(apexes)) if apexes else float("nan")


def pool_group(group: str, rows: Sequence[Summary], seed: int) -> list[Group]:
    """Aggregate the summary rows of several policies of one recipe, one row per command."""
    found = []
    for command in sorted({row.command_m for row in rows}):
        own = [row for row in rows if row.command_m == command]
        errors = np.array([row.median_error_m for row in own])
        low, high = statistics.median_interval(list(errors[:, None]), seed)
        stds = np.array([row.std_m for row in own if row.hops])
        found.append(
            Group(
                group=group,
                command_m=command,
                policies=len(own),
                motionless=sum(not row.hops for row in own),
                median_error_m=float(np.median(errors)),
                median_error_low_m=low,
                median_error_high_m=high,
                worst_abs_error_m=float(np.abs(errors).max()),
                median_std_m=statistics.of(np.median, stds),
                skipped_hops=sum(row.skipped_hops for row in own),
                body_contacts=sum(row.body_contacts for row in own),
            )
        )
    return found
