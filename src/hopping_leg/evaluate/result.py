"""The numbers of an evaluation: recorded runs, measured and arranged; as JSON."""

import itertools
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.evaluate import metrics, statistics
from hopping_leg.evaluate.motor_load import MotorLoad, motor_load, unknown
from hopping_leg.evaluate.trials import Run
from hopping_leg.io import plain
from hopping_leg.robot import Robot

SCHEMA = 2
"""Version of the JSON, raised when a name changes its meaning."""


@dataclass(frozen=True, kw_only=True)
class HopStatistics:
    """One controller at one command, hops of all its runs pooled; 95 % intervals resample runs."""

    controller: str
    robot: str
    command_m: float
    median_error_m: float
    """Median of apex minus command, misses included."""
    median_error_low_m: float
    median_error_high_m: float
    median_abs_error_m: float
    """Median of |apex - command|, misses included."""
    mean_abs_error_m: float
    """Mean of |apex - command|, misses included."""
    mean_abs_error_low_m: float
    mean_abs_error_high_m: float
    std_m: float
    """Hop-to-hop standard deviation of the apex."""
    std_low_m: float
    std_high_m: float
    iqr_m: float
    """Interquartile range of the apex."""
    hops: int
    """In-flight apexes counted."""
    skipped_hops: int
    stance_bounces: int
    hop_rate_hz: float
    flight_fraction: float
    min_base_height_m: float
    max_sink_m: float
    body_contacts: int
    """Times base or knee touched the ground."""
    base_contacts: int
    knee_contacts: int
    peak_hip_torque_nm: float
    peak_knee_torque_nm: float
    measured_s: float
    """Time in which hops were counted."""
    runs: int
    missed_runs: int
    """Runs without a hop: their errors are misses, standing height minus command."""


@dataclass(frozen=True, kw_only=True)
class Summary(MotorLoad, HopStatistics):
    """How one controller hops at one command, and what that is for the motors."""


@dataclass(frozen=True)
class Group:
    """Several policies of one recipe, trained with different seeds, at one command."""

    group: str
    command_m: float
    policies: int
    motionless: int
    """Policies that never hopped; their errors are misses, standing height minus command."""
    median_error_m: float
    """Median over policies of each policy's median error."""
    median_error_low_m: float
    """Lower end of its 95 % bootstrap interval, policies resampled."""
    median_error_high_m: float
    worst_abs_error_m: float
    median_std_m: float
    skipped_hops: int
    body_contacts: int


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
    runs: Sequence[Run], controllers: Sequence[str], seed: int, robot: Robot | None = None
) -> Evaluation:
    """Measure runs and arrange the numbers; conditions, versions and notes stay empty.

    Args:
        runs: Runs of all controllers.
        controllers: Their names in the order of the rows.
        seed: Seed of the bootstrap.
        robot: The leg of all runs; without it nothing is told of its motors.
    """
    measured = [(run, metrics.measure(run.trace)) for run in runs]
    own = {name: [pair for pair in measured if pair[0].controller == name] for name in controllers}

    def groups(*kinds: str) -> list[tuple[str, float, list[metrics.HopWindow]]]:
        """Return the windows in trials of some kinds by controller and rising command."""
        found: dict[tuple[int, float], list[metrics.HopWindow]] = {}
        for number, name in enumerate(controllers):
            for kind in kinds:
                for run, windows in own[name]:
                    for window in windows if run.trial.kind == kind else ():
                        found.setdefault((number, window.command), []).append(window)
        return [(controllers[number], at, found[number, at]) for number, at in sorted(found)]

    def rows(*kinds: str) -> list[Summary]:
        return [summarise(name, at, found, seed, robot) for name, at, found in groups(*kinds)]

    estimators = (metrics.judge_estimator(n, [run.trace for run, _ in own[n]]) for n in controllers)
    return Evaluation(
        summary=rows("fixed", "sequence"),
        sequence=rows("sequence"),
        ladder=rows("ladder"),
        staircase=[stair for name in controllers for stair in _staircase(name, own[name])],
        neighbours=[
            {"controller": name, "neighbours": _compare(own[name], seed)} for name in controllers
        ],
        distributions=[
            {
                "controller": name,
                "command_m": at,
                "apexes_m": np.round(metrics.pooled_apexes(found), 5).tolist(),
            }
            for name, at, found in groups("fixed", "sequence")
        ],
        estimators=[found for found in estimators if found],
    )


Measured = Sequence[tuple[Run, list[metrics.HopWindow]]]


def _compare(measured: Measured, seed: int) -> list[statistics.Neighbours]:
    """Compare neighbouring commands: within a run that has both, or of runs of equal number."""
    apexes: dict[float, dict[tuple[str, int], Array]] = {}
    for run, windows in measured:
        for window in windows if run.trial.kind in ("fixed", "sequence") else ():
            key, found = (run.trial.kind, run.repeat), apexes.setdefault(window.command, {})
            found[key] = np.concatenate([found.get(key, np.empty(0)), window.apex])
    rows = []
    for low, high in itertools.pairwise(sorted(apexes)):
        pairs = [key for key in apexes[low] if key in apexes[high]]
        lower, upper = ([apexes[command][key] for key in pairs] for command in (low, high))
        rows.append(statistics.compare(low, lower, high, upper, seed))
    return rows


def _staircase(label: str, measured: Measured) -> list[Staircase]:
    """Return how all runs up the staircase went together, if there are any."""
    stairs = [(run, windows) for run, windows in measured if run.trial.kind == "staircase"]
    if not stairs:
        return []
    steps = [list(group) for group in zip(*(windows for _, windows in stairs), strict=True)]
    commands = [step[0].command for step in steps]
    errors = [np.median(np.concatenate(metrics.errors_of(step))) for step in steps]
    medians, hopped = np.add(commands, errors), all(len(metrics.pooled_apexes(s)) for s in steps)
    per_run = np.array([[statistics.of(np.median, w.apex) for w in run] for _, run in stairs])
    return [
        Staircase(
            controller=label,
            commands_m=commands,
            median_apexes_m=medians.tolist(),
            monotone=bool((np.diff(medians) > 0).all() and hopped),
            monotone_runs=int((np.diff(per_run, axis=1) > 0).all(axis=1).sum()),
            runs=len(stairs),
            skipped_hops=sum(metrics.skipped_in_run(run.trace) for run, _ in stairs),
        )
    ]


def summarise(
    controller: str,
    command: float,
    windows: Sequence[metrics.HopWindow],
    seed: int,
    robot: Robot | None = None,
) -> Summary:
    """Pool all windows of one controller at one command; the seed is of the bootstrap."""
    parts = [w.part for w in windows]
    load = motor_load(parts, robot) if robot else unknown()
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
