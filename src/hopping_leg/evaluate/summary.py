"""How a controller hops at a command: its runs pooled, and policies of one recipe together."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.evaluate import metrics, statistics
from hopping_leg.evaluate.motor_load import MotorLoad, motor_load, unknown
from hopping_leg.robot import Robot


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
