"""What the loader rejects, and what it leaves out and warns about.

A check raises, or changes the inspection's table to what can be believed. Rows in messages are
those of the file, the first below the header being 0.
"""

from dataclasses import replace

import numpy as np
import polars as pl

from hopping_leg.arrays import BoolArray
from hopping_leg.errors import RecordingError
from hopping_leg.identify import signal_checks, torque_checks, unit_checks
from hopping_leg.identify.recording_format import MEASURED, PAIRS
from hopping_leg.identify.unit_checks import STALL, Inspection, row_period

TINY, HUGE = 1e-30, 1e30
"""No sensor gives a magnitude beyond these; uninitialised memory read as a float does."""
_MOSTLY = 0.1  # share of garbage above which nothing in a column is believed
_STARTUP = 10  # rows at the beginning that are searched for commands that were not applied
_JUMP = 0.05  # step out of rows of zeros, rad, that only a sensor that woke up makes
_LEAST_ROWS = 20  # rows with a position that a recording needs
_LEAST_MOTION = 0.02  # motion of the joint that moves more, rad; below it nothing can be identified
_SMALL_MOTION = 0.5  # below it, rad, positions may be revolutions


def check_table(inspection: Inspection) -> None:
    """Leave what can be believed in the table, warn of the rest, or raise RecordingError."""
    if inspection.table.height == 0:
        raise RecordingError(f"{inspection.origin} has no rows below its header; record again.")
    if "time_s" not in inspection.table.columns:
        raise RecordingError(
            f"{inspection.origin} has no column 'time_s'; a recording needs time and position."
        )
    signal_checks.check_clock(inspection)
    _drop_garbage(inspection)
    _drop_zeros(inspection)
    _drop_startup(inspection)
    _align_commands(inspection)
    signal_checks.drop_spikes(inspection)
    unit_checks.check_units(inspection)
    _check_motion(inspection)
    signal_checks.check_steadiness(inspection)
    unit_checks.check_velocity(inspection)
    signal_checks.check_posture(inspection)
    torque_checks.check_torque(inspection)
    _warn_of_stalls(inspection)


def _drop_garbage(inspection: Inspection) -> None:
    for column in inspection.table.select(pl.selectors.float()).columns:
        values = inspection.floats(column)
        size = np.abs(values)
        garbage = ((size > 0) & (size < TINY)) | (size > HUGE)
        if not garbage.any():
            continue
        first = int(np.argmax(garbage))
        found = (
            f"{inspection.named(column)}, row {inspection.row(first)}:"
            f" {values[first]:.3g} is no measurement but uninitialised memory"
            f" ({int(garbage.sum())} such values)"
        )
        if garbage.mean() > _MOSTLY:
            inspection.warn(f"{found}; the column is left out")
            inspection.drop(column)
        else:
            inspection.warn(f"{found}; left out")
            kept = pl.when(pl.Series(garbage)).then(None).otherwise(pl.col(column))
            inspection.table = inspection.table.with_columns(kept.alias(column))


def _drop_zeros(inspection: Inspection) -> None:
    """Leave out measured columns that are zero throughout; a command may well be zero."""
    joints = "torque_command" if inspection.metadata.onboard == "torque" else "position_command"
    for column in (*MEASURED, *PAIRS[joints]):
        values = inspection.floats(column)
        if np.isnan(values).all() or np.nanmax(np.abs(values)) > 0:
            continue
        sentence = f"{inspection.named(column)} is zero in all rows from {inspection.row(0)} on"
        if column in MEASURED:
            inspection.warn(f"{sentence}: not recorded, left out")
            inspection.drop(column)
        else:
            inspection.warn(f"{sentence}: kept as a command of zero")


def _drop_startup(inspection: Inspection) -> None:
    known = inspection.metadata.startup_rows
    already = inspection.row(0)
    if known and already:
        return  # saved again after they were left out
    rows, reason = max(
        (min(known, inspection.table.height), "the rig's start-up"),
        (_asleep(inspection), "all joints read zero, then jump"),
        (_unapplied(inspection), "commands beyond all later ones that no measured torque follows"),
        key=lambda found: found[0],
    )
    if rows:
        pairs = PAIRS["torque_command"] + PAIRS["position"]
        present = [c for c in pairs if c in inspection.table.columns]
        columns = ", ".join(map(inspection.named, present[:2]))
        inspection.warn(
            f"rows {already} to {inspection.row(rows - 1)} are start-up rows ({reason};"
            f" {columns}); left out"
        )
    inspection.table = inspection.table.slice(rows)


def _align_commands(inspection: Inspection) -> None:
    """Put each command beside the state before it acted; the last row's is unknown."""
    if inspection.metadata.sample == "before-command":
        return
    inspection.metadata = replace(inspection.metadata, sample="before-command")
    commands = [c for q in PAIRS if q.endswith("_command") for c in PAIRS[q]]
    commands += [*PAIRS["stiffness"], *PAIRS["damping"]]
    later = [pl.col(c).shift(-1) for c in commands if c in inspection.table.columns]
    inspection.table = inspection.table.with_columns(later)[:-1]


def _asleep(inspection: Inspection) -> int:
    q = np.stack([inspection.floats(c) for c in PAIRS["position"]], axis=-1)
    q = q[:, ~np.isnan(q).all(axis=0)]
    awake = np.flatnonzero((np.nan_to_num(q) != 0).any(axis=-1))
    if not len(awake) or awake[0] == 0 or awake[0] > len(q) // 2:
        return 0
    return int(awake[0]) if np.nanmax(np.abs(q[awake[0]])) > _JUMP else 0


def _unapplied(inspection: Inspection) -> int:
    """Return the rows up to the last command that nothing followed, and its answer's delay."""
    if inspection.metadata.onboard != "torque":
        return 0
    last = 0
    for commanded, measured in zip(PAIRS["torque_command"], PAIRS["torque"], strict=True):
        command = np.abs(np.nan_to_num(inspection.floats(commanded)))
        torque = np.abs(inspection.floats(measured))
        if len(command) <= 2 * _STARTUP or np.isnan(torque[_STARTUP:]).all():
            continue
        flagged: BoolArray = command[:_STARTUP] > 1.2 * command[_STARTUP:].max()
        answer = np.fmax.reduce([torque[late : _STARTUP + late] for late in range(3)])
        ignored = np.flatnonzero(flagged & (np.nan_to_num(answer) < 0.3 * command[:_STARTUP]))
        if len(ignored) and command[_STARTUP:].max() > 0:
            last = max(last, int(ignored[-1]) + 3)
    return last


def _check_motion(inspection: Inspection) -> None:
    table, origin = inspection.table, inspection.origin
    spans = {}
    for column in PAIRS["position"]:
        values = inspection.floats(column)
        known = np.count_nonzero(~np.isnan(values))
        if known >= _LEAST_ROWS:
            spans[column] = float(np.nanmax(values) - np.nanmin(values))
        elif not known:
            inspection.warn(f"{inspection.named(column)} was not recorded")
    if not spans:
        raise RecordingError(
            f"{origin} is too short: {table.height} rows, and no joint has {_LEAST_ROWS} positions"
            f" ({' or '.join(map(inspection.named, PAIRS['position']))})."
        )
    widest = max(spans, key=spans.__getitem__)
    if spans[widest] < _LEAST_MOTION:
        raise RecordingError(
            f"{origin} is at rest: {inspection.named(widest)} spans {spans[widest]:.2g} rad;"
            f" nothing can be identified below {_LEAST_MOTION:g} rad, play an excitation."
        )
    if spans[widest] < _SMALL_MOTION:
        inspection.warn(
            f"{inspection.named(widest)} spans only {spans[widest]:.2g}; check that it is in rad,"
            " not in revolutions"
        )


def _warn_of_stalls(inspection: Inspection) -> None:
    """Say where rows are missing; windows do not reach across."""
    time = inspection.floats("time_s")
    steps, period = np.diff(time), row_period(time, inspection.metadata.period)
    stalls = np.flatnonzero(steps > STALL * period) + 1
    for index in stalls[:3]:
        gap = time[index] - time[index - 1]
        inspection.warn(
            f"{inspection.named('time_s')}: stall of {gap * 1e3:.1f} ms, {gap / period:.1f}"
            f" periods, before row {inspection.row(index)}"
        )
    if len(stalls) > 3:
        inspection.warn(
            f"{inspection.named('time_s')}: {len(stalls) - 3} further stalls, the last before row"
            f" {inspection.row(stalls[-1])}"
        )
