"""The numbers of an evaluation: recorded runs, measured and arranged; as JSON."""

import itertools
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
import polars as pl

from hopping_leg.arrays import Array
from hopping_leg.evaluate import metrics, statistics
from hopping_leg.evaluate.motor_load import UNKNOWN, MotorLoad, motor_load
from hopping_leg.evaluate.prediction import Prediction
from hopping_leg.evaluate.trials import Run
from hopping_leg.io import plain
from hopping_leg.robot import GRAVITY, Robot

SCHEMA = 2  # Version of the JSON, raised when a name changes its meaning

_WHOLE = ("height_m", "foot_clearance_m", "hip_torque_nm", "knee_torque_nm")


@dataclass(frozen=True, kw_only=True)
class Summary(MotorLoad):
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
    std_m: float
    """Hop-to-hop standard deviation of the apex."""
    hops: int
    """In-flight apexes counted."""
    skipped_hops: int
    stance_bounces: int
    hop_rate_hz: float
    energy_per_hop_j: float
    """``mean_power_w`` over the hop rate."""
    electrical_energy_per_hop_j: float
    ballistic_energy_j: float
    """Least for a landing that gives nothing back: m g from the height of the start to the apex."""
    energy_over_ballistic: float
    """Electrical energy of a hop over it."""
    flight_fraction: float
    min_base_height_m: float
    max_sink_m: float
    body_contacts: int
    """Times base or knee touched the ground."""
    base_contacts: int
    knee_contacts: int
    peak_hip_torque_nm: float
    peak_knee_torque_nm: float
    runs: int
    missed_runs: int
    """Runs without a hop: their errors are misses, standing height minus command."""


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
    ladder: list[Summary]
    staircase: list[Staircase]
    neighbours: list[dict[str, Any]]
    """Neighbouring commands compared: controller, neighbours."""
    distributions: list[dict[str, Any]]
    """Apexes behind ``summary``: controller, command_m, apexes_m."""
    predictions: list[Prediction] = field(default_factory=list)
    """What the legs do that an identification allows, if they were what hopped."""
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

    def to_json(self) -> dict[str, Any]:
        """Return plain values; numbers that do not exist are None."""
        return {"schema": SCHEMA, **plain(asdict(self))}


Windows = dict[float, list[tuple[Run, metrics.HopWindow]]]
"""Stretches of one controller's runs by rising command, m."""


def tabulate(runs: Sequence[Run], seed: int, robot: Robot | None = None) -> Evaluation:
    """Measure runs and arrange the numbers; conditions, versions and notes stay empty.

    Controllers come in the order of their runs; the seed is the bootstrap's. Without the robot of
    all runs nothing is told of its motors.
    """
    measured = [(run, window) for run in runs for window in metrics.measure(run.trace)]
    measured.sort(key=lambda pair: pair[1].command)

    def windows(*kinds: str) -> dict[str, Windows]:
        """Return the windows in trials of some kinds by controller."""
        found: dict[str, Windows] = {run.controller: {} for run in runs}
        for run, window in measured:
            if run.trial.kind in kinds:
                found[run.controller].setdefault(window.command, []).append((run, window))
        return found

    def rows(shown: dict[str, Windows]) -> list[Summary]:
        return [
            summarise(name, at, [window for _, window in found], seed, robot)
            for name, own in shown.items()
            for at, found in own.items()
        ]

    pooled = windows("fixed", "sequence")
    return Evaluation(
        summary=rows(pooled),
        ladder=rows(windows("ladder")),
        staircase=[_staircase(name, own) for name, own in windows("staircase").items() if own],
        neighbours=[
            {"controller": name, "neighbours": _compare(own, seed)} for name, own in pooled.items()
        ],
        distributions=[
            {
                "controller": name,
                "command_m": at,
                "apexes_m": np.round(np.concatenate([w.apex for _, w in found]), 5).tolist(),
            }
            for name, own in pooled.items()
            for at, found in own.items()
        ],
    )


def _compare(steps: Windows, seed: int) -> list[statistics.Neighbours]:
    """Compare neighbouring commands: within a run that has both, or of runs of equal number."""
    apexes: dict[float, dict[tuple[str, int], Array]] = {}
    for command, found in steps.items():
        own = apexes.setdefault(command, {})
        for run, window in found:
            key = (run.trial.kind, run.repeat)
            own[key] = np.concatenate([own.get(key, np.empty(0)), window.apex])
    rows = []
    for low, high in itertools.pairwise(apexes):
        pairs = [key for key in apexes[low] if key in apexes[high]]
        lower, upper = ([apexes[command][key] for key in pairs] for command in (low, high))
        rows.append(statistics.compare(low, lower, high, upper, seed))
    return rows


def _staircase(label: str, steps: Windows) -> Staircase:
    windows = [[window for _, window in found] for found in steps.values()]
    errors = [np.median(np.concatenate(metrics.errors_of(step))) for step in windows]
    medians = np.add(list(steps), errors)
    hopped = all(len(metrics.pooled_apexes(step)) for step in windows)
    per_run = np.array([[statistics.of(np.median, w.apex) for w in step] for step in windows])
    runs = [run for run, _ in next(iter(steps.values()))]
    return Staircase(
        controller=label, commands_m=list(steps), median_apexes_m=medians.tolist(),
        monotone=bool((np.diff(medians) > 0).all() and hopped),
        monotone_runs=int((np.diff(per_run, axis=0) > 0).all(axis=0).sum()),
        runs=len(runs), skipped_hops=sum(metrics.skipped_in_run(run.trace) for run in runs),
    )  # fmt: skip


def summarise(
    controller: str,
    command: float,
    windows: Sequence[metrics.HopWindow],
    seed: int,
    robot: Robot | None = None,
) -> Summary:
    """Pool all windows of one controller at one command; the seed is of the bootstrap."""
    parts = [w.part for w in windows]
    load = motor_load(parts, robot) if robot else UNKNOWN
    apex, errors = metrics.pooled_apexes(windows), metrics.errors_of(windows)
    every = np.concatenate(errors)
    low, high = statistics.median_interval(errors, seed)
    settled = sum(w.settled for w in windows)
    per_second = 1 / settled if settled else float("nan")
    period = settled / len(apex) if len(apex) else np.nan
    electrical = load.mean_electrical_power_w * period
    lift = statistics.of(np.mean, apex) - np.mean([w.standing for w in windows])
    ballistic = float(robot.mass * GRAVITY * lift) if robot else np.nan
    whole = pl.concat([part.table.select(_WHOLE) for part in parts])
    base, knee = (sum(w.contacts(name) for w in windows) for name in ("base", "knee"))
    return Summary(
        controller=controller,
        robot=str(parts[0].header.get("robot", "")),
        command_m=command,
        median_error_m=float(np.median(every)),
        median_error_low_m=low, median_error_high_m=high,
        median_abs_error_m=float(np.median(np.abs(every))),
        mean_abs_error_m=float(np.abs(every).mean()),
        std_m=statistics.of(np.std, apex),
        hops=len(apex),
        skipped_hops=sum(w.skipped for w in windows),
        stance_bounces=sum(w.bounces for w in windows),
        hop_rate_hz=len(apex) * per_second,
        energy_per_hop_j=load.mean_power_w * period,
        electrical_energy_per_hop_j=electrical, ballistic_energy_j=ballistic,
        energy_over_ballistic=electrical / ballistic if ballistic > 0 else np.nan,
        flight_fraction=sum(w.flight for w in windows) * per_second,
        min_base_height_m=float(whole["height_m"].to_numpy().min()),
        max_sink_m=max(0.0, float(-whole["foot_clearance_m"].to_numpy().min())),
        body_contacts=base + knee, base_contacts=base, knee_contacts=knee,
        peak_hip_torque_nm=float(np.abs(whole["hip_torque_nm"].to_numpy()).max()),
        peak_knee_torque_nm=float(np.abs(whole["knee_torque_nm"].to_numpy()).max()),
        runs=len(windows), missed_runs=sum(not len(w.apex) for w in windows), **vars(load),
    )  # fmt: skip
