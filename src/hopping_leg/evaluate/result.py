"""The numbers of an evaluation: recorded runs, measured and arranged; as JSON."""

import itertools
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.evaluate import metrics, statistics, trials
from hopping_leg.evaluate.summary import Group, Summary, summarise
from hopping_leg.io import plain
from hopping_leg.robot import Robot

SCHEMA = 2
"""Version of the JSON, raised when a name changes its meaning."""


@dataclass(frozen=True)
class Staircase:
    """The 30 s trial of one controller."""

    controller: str
    commands_m: list[float]
    median_apexes_m: list[float]
    monotone: bool
    """Medians over all seeds rise at every step."""
    monotone_runs: int
    """Runs whose own medians rise at every step."""
    runs: int
    skipped_hops: int
    """Over the whole 30 s after the start, all runs."""


@dataclass(frozen=True)
class Evaluation:
    """Everything measured, without the traces."""

    summary: list[Summary]
    """One row per controller and command: fixed trials and the sequence pooled."""
    sequence: list[Summary]
    """The sequence alone."""
    ladder: list[Summary]
    staircase: list[Staircase]
    neighbours: list[dict[str, Any]]
    """Neighbouring commands compared: controller, neighbours."""
    distributions: list[dict[str, Any]]
    """Apexes behind ``summary``: controller, command_m, apexes_m."""
    estimators: list[metrics.Estimator] = field(default_factory=list)
    groups: list[Group] = field(default_factory=list)
    conditions: dict[str, Any] = field(default_factory=dict)
    """Robot, digest, floor, disturbance, seeds, steps, rates."""
    versions: dict[str, str] = field(default_factory=dict)
    """Versions of the software."""
    notes: list[str] = field(default_factory=list)
    """What was left out and why."""
    command: str = ""
    """What makes this evaluation again."""
    secondary: "Evaluation | None" = None
    """The same on another floor, if that was asked for."""

    @property
    def controllers(self) -> list[str]:
        """Names in the order of the rows."""
        return list(dict.fromkeys(row.controller for row in self.summary))

    def rows(self, controller: str) -> list[Summary]:
        """Return a controller's rows of the summary, by rising command."""
        return [row for row in self.summary if row.controller == controller]

    def to_json(self) -> dict[str, Any]:
        """Return plain values; numbers that do not exist are None."""
        return {"schema": SCHEMA, **plain(asdict(self))}


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
