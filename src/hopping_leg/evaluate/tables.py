"""Recorded runs turned into the tables of an evaluation."""

import itertools
from collections.abc import Sequence

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.evaluate.estimator import judge_estimator
from hopping_leg.evaluate.metrics import Window, measure, pooled_apexes, skipped_in_run
from hopping_leg.evaluate.pooling import summarise
from hopping_leg.evaluate.result import Comparison, Evaluation, Staircase, Summary
from hopping_leg.evaluate.runs import Run
from hopping_leg.evaluate.statistics import Neighbours, compare


def tabulate(runs: Sequence[Run], controllers: Sequence[str], seed: int) -> Evaluation:
    """Measure runs and arrange the numbers; conditions, versions and notes stay empty.

    Args:
        runs: Of all controllers.
        controllers: Their names in the order of the rows.
        seed: Of the bootstrap.
    """
    of = {name: [run for run in runs if run.controller == name] for name in controllers}
    fixed = {name: _windows(of[name], "fixed") for name in controllers}
    sequence = {name: _windows(of[name], "sequence") for name in controllers}
    pooled = {name: fixed[name] + sequence[name] for name in controllers}
    ladder = {name: _windows(of[name], "ladder") for name in controllers}
    robot = str(runs[0].trace.header.get("robot", "")) if runs else ""

    def rows(windows: dict[str, list[Window]]) -> list[Summary]:
        return [
            summarise(name, robot, command, group, seed)
            for name in controllers
            for command, group in _by_command(windows[name]).items()
        ]

    apexes = {name: _apexes(pooled[name]) for name in controllers}
    stairs = {n: [run for run in of[n] if run.trial.kind == "staircase"] for n in controllers}
    return Evaluation(
        summary=rows(pooled),
        sequence=rows(sequence),
        ladder=rows(ladder),
        staircase=[_staircase(name, found) for name, found in stairs.items() if found],
        neighbours=[Comparison(name, _compare(apexes[name])) for name in controllers],
        distributions=[
            {"controller": name, "command_m": command, "apexes_m": np.round(apex, 5).tolist()}
            for name in controllers
            for command, apex in apexes[name].items()
        ],
        estimators=[
            found
            for name in controllers
            if (found := judge_estimator(name, [run.trace for run in of[name]]))
        ],
    )


def _windows(runs: Sequence[Run], kind: str) -> list[Window]:
    return [w for run in runs if run.trial.kind == kind for w in measure(run.trace)]


def _by_command(windows: Sequence[Window]) -> dict[float, list[Window]]:
    commands = sorted({w.command for w in windows})
    return {c: [w for w in windows if w.command == c] for c in commands}


def _apexes(windows: Sequence[Window]) -> dict[float, Array]:
    return {c: pooled_apexes(group) for c, group in _by_command(windows).items()}


def _compare(apexes: dict[float, Array]) -> list[Neighbours]:
    return [
        compare(low, apexes[low], high, apexes[high]) for low, high in itertools.pairwise(apexes)
    ]


def _staircase(label: str, runs: Sequence[Run]) -> Staircase:
    measured = [measure(run.trace) for run in runs]
    steps = [list(group) for group in zip(*measured, strict=True)]
    medians = np.array([_median(pooled_apexes(step)) for step in steps])
    per_run = np.array([[_median(w.apex) for w in run] for run in measured])
    return Staircase(
        controller=label,
        commands_m=[step[0].command for step in steps],
        median_apexes_m=medians.tolist(),
        monotone=bool((np.diff(medians) > 0).all()),
        monotone_runs=int((np.diff(per_run, axis=1) > 0).all(axis=1).sum()),
        runs=len(runs),
        skipped_hops=sum(skipped_in_run(run.trace) for run in runs),
    )


def _median(values: Array) -> float:
    return float(np.median(values)) if len(values) else float("nan")
