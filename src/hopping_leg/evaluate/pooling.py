"""Windows of several runs pooled into the rows of the tables."""

from collections.abc import Sequence

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.evaluate.metrics import Window, pooled_apexes
from hopping_leg.evaluate.result import Group, Summary
from hopping_leg.evaluate.statistics import median_interval


def summarise(
    controller: str, robot: str, command: float, windows: Sequence[Window], seed: int
) -> Summary:
    """Pool all windows of one controller at one command.

    Args:
        controller: As named on the command line.
        robot: Name of the leg.
        command: Desired apex height, m.
        windows: One per run and stretch at this command.
        seed: Of the bootstrap.
    """
    apex = pooled_apexes(windows)
    low, high = median_interval([w.error for w in windows], seed)
    settled = sum(w.settled for w in windows)
    per_second = 1 / settled if settled else float("nan")
    quartiles = np.percentile(apex, [25, 75]) if len(apex) else np.full(2, np.nan)
    peak = np.max([w.peak_torque for w in windows], axis=0)
    rms = np.sqrt(np.mean([np.square(w.rms_torque) for w in windows], axis=0))
    return Summary(
        controller=controller,
        robot=robot,
        command_m=command,
        median_error_m=_of(np.median, apex - command),
        median_error_low_m=low,
        median_error_high_m=high,
        mean_abs_error_m=_of(np.mean, np.abs(apex - command)),
        std_m=_of(np.std, apex),
        iqr_m=float(quartiles[1] - quartiles[0]),
        hops=len(apex),
        skipped_hops=sum(w.skipped for w in windows),
        stance_bounces=sum(w.bounces for w in windows),
        hop_rate_hz=len(apex) * per_second,
        flight_fraction=sum(w.flight for w in windows) * per_second,
        min_base_height_m=min(w.min_height for w in windows),
        max_sink_m=max(w.max_sink for w in windows),
        body_contacts=sum(w.base_contacts + w.knee_contacts for w in windows),
        base_contacts=sum(w.base_contacts for w in windows),
        knee_contacts=sum(w.knee_contacts for w in windows),
        peak_hip_torque_nm=float(peak[0]),
        peak_knee_torque_nm=float(peak[1]),
        rms_hip_torque_nm=float(rms[0]),
        rms_knee_torque_nm=float(rms[1]),
        measured_s=settled,
        runs=len(windows),
    )


def _of(statistic: "np.ufunc | object", values: Array) -> float:
    return float(statistic(values)) if len(values) else float("nan")  # type: ignore[operator]


def pool_group(group: str, rows: Sequence[Summary], seed: int) -> list[Group]:
    """Aggregate several policies of one recipe, one row per command.

    Args:
        group: Name of the recipe or pattern.
        rows: Summary rows of all its policies.
        seed: Of the bootstrap.
    """
    return [
        _group_row(group, command, [row for row in rows if row.command_m == command], seed)
        for command in sorted({row.command_m for row in rows})
    ]


def _group_row(group: str, command: float, rows: Sequence[Summary], seed: int) -> Group:
    errors = np.array([row.median_error_m for row in rows])
    spreads = np.array([row.std_m for row in rows])
    known = errors[np.isfinite(errors)]
    low, high = median_interval(list(known[:, None]), seed)
    return Group(
        group=group,
        command_m=command,
        policies=len(rows),
        motionless=len(rows) - len(known),
        median_error_m=_of(np.median, known),
        median_error_low_m=low,
        median_error_high_m=high,
        worst_abs_error_m=_of(np.max, np.abs(known)),
        median_std_m=_of(np.median, spreads[np.isfinite(spreads)]),
        skipped_hops=sum(row.skipped_hops for row in rows),
        body_contacts=sum(row.body_contacts for row in rows),
    )
