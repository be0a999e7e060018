"""What the loader rejects, and what it leaves out and warns about.

A check raises, or changes the inspection's table to what can be believed.
"""

from dataclasses import replace

import numpy as np
import polars as pl

from hopping_leg.arrays import Array, IntArray
from hopping_leg.errors import RecordingError
from hopping_leg.identify import unit_checks
from hopping_leg.identify.recording_format import MEASURED, PAIRS
from hopping_leg.identify.unit_checks import FASTEST, Inspection
from hopping_leg.robot import JOINTS

STALL = 2.0
"""A gap between rows of more than this many periods is a stall."""
TINY, HUGE = 1e-30, 1e30
"""No sensor gives a magnitude beyond these; uninitialised memory read as a float does."""
_MOSTLY = 0.1  # share of garbage above which nothing in a column is believed
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
    _check_clock(inspection)
    _drop_garbage(inspection)
    _drop_startup(inspection)
    _align_commands(inspection)
    _mend_angles(inspection)
    unit_checks.check_units(inspection)
    _check_motion(inspection)
    _check_angles(inspection)
    unit_checks.check_velocity(inspection)
    unit_checks.check_torque(inspection)
    _warn_of_stalls(inspection)


_TIME_UNITS = {"ms": 1e3, "us": 1e6, "ns": 1e9, "min": 1 / 60}
_SPARSEST = 20.0  # periods per row beyond which the rate or the time's unit must be wrong
_DAY = 86400.0
_COUNTERS = [2.0**bits * 10.0**-n for bits in (16, 24, 31, 32) for n in (9, 6, 3, 0)] + [_DAY]
"""Where counters of nanoseconds to seconds begin anew, and the time of day, s."""
_SOON = 5.0  # usual steps within which a wrapped clock goes on
_ALIKE = 0.01  # periods within which two steps are one
_COARSE, _USELESS = 0.15, 0.3  # periods that a clock's tick may last: with a warning, and at all


def row_period(time: Array, period: float) -> float:
    """Return the usual time from row to row, s: the nominal period, or more in a sparse log."""
    return max(period, float(np.median(np.diff(time)))) if len(time) > 1 else period


def _check_clock(inspection: Inspection) -> None:
    """Refuse time that is missing, not increasing, too coarse or in another unit.

    A counter that wrapped goes on.
    """
    time, where = inspection.floats("time_s"), inspection.named("time_s")
    bad = np.flatnonzero(~np.isfinite(time))
    if len(bad):
        inspection.refuse(
            f"{where} has no time in row {inspection.row(bad[0])}; every row needs one."
        )
    _unwrap_time(inspection, time)
    steps, metadata = np.diff(time), inspection.metadata
    if not len(steps):
        return
    tick = _tick(steps, metadata.period)
    if tick > _COARSE * metadata.period:
        sentence = f"{where} is too coarse: it counts in {tick * 1e3:.4g} ms, where a row takes"
        sentence += f" {metadata.period * 1e3:.4g}; record it to a tenth of that"
        if tick > _USELESS * metadata.period:
            inspection.refuse(f"{sentence}.")
        inspection.warn(sentence)
    back = np.flatnonzero(steps <= 0)
    if len(back):
        index = back[0] + 1
        inspection.refuse(
            f"{where} does not increase in row {inspection.row(index)}:"
            f" {time[index]:.9g} s comes after {time[index - 1]:.9g} s; remove the row, or split"
            " the file where a new log begins."
        )
    step = float(np.median(steps))
    periods = step * metadata.rate_hz
    if not 0.5 <= periods <= _SPARSEST:
        unit = next((u for u, f in _TIME_UNITS.items() if 0.8 < periods / f < 1.25), None)
        guess = f"the time seems to be in {unit}" if unit else "one of the two is wrong"
        inspection.refuse(
            f"{where} steps by {step:.3g} from row to row but the metadata's rate_hz ="
            f" {metadata.rate_hz:g} means {metadata.period:.3g} s; {guess}."
        )


def _unwrap_time(inspection: Inspection, time: Array) -> None:
    """Let time, (ticks,), go on where its counter began anew."""
    steps = np.diff(time)
    if not (steps > 0).any():
        return
    usual = float(np.median(steps[steps > 0]))
    wraps: list[str] = []
    for index in np.flatnonzero(steps < 0).tolist():
        turns = [c for c in _COUNTERS if 0 < steps[index] + c < _SOON * usual]
        if turns:
            time[index + 1 :] += turns[0]
            wraps.append(f"{turns[0]:.10g} s before row {inspection.row(index + 1)}")
    if wraps:
        counted = f"{inspection.named('time_s')} is a counter that begins anew at"
        inspection.warn(f"{counted} {', '.join(wraps[:3])}; it was made to go on")
        inspection.set("time_s", time)


@np.errstate(over="ignore", invalid="ignore")
def _tick(steps: Array, period: float) -> float:
    """Return what a clock counts in, s, where rows are no whole number of that apart, else 0."""
    sizes = np.unique(steps / period)
    sizes = sizes[np.append(True, np.diff(sizes) > _ALIKE)]
    tick = float(np.diff(sizes).min(initial=np.inf))
    counts = np.append(sizes, 1.0) / tick
    odd = np.abs(counts - np.rint(counts))
    counted = np.isfinite(tick) and sizes[0] >= 0 and odd[:-1].max() < 0.1
    return tick * period if counted and (odd[-1] > 2 * _ALIKE or sizes[0] == 0 < tick - 1) else 0.0


def _warn_of_stalls(inspection: Inspection) -> None:
    """Say where rows are missing; windows do not reach across."""
    time, where = inspection.floats("time_s"), inspection.named("time_s")
    steps, period = np.diff(time), row_period(time, inspection.metadata.period)
    stalls = np.flatnonzero(steps > STALL * period)
    for stall in stalls[:3]:
        inspection.warn(
            f"{where}: stall of {steps[stall] * 1e3:.1f} ms, {steps[stall] / period:.1f} periods,"
            f" before row {inspection.row(stall + 1)}"
        )
    if len(stalls) > 3:
        last = inspection.row(stalls[-1] + 1)
        inspection.warn(f"{where}: {len(stalls) - 3} further stalls, the last before row {last}")


def _drop_garbage(inspection: Inspection) -> None:
    """Leave out uninitialised memory, and measured columns that are zero throughout."""
    for column in inspection.table.select(pl.selectors.float()).columns:
        values = inspection.floats(column)
        size = np.abs(values)
        garbage = ((size > 0) & (size < TINY)) | (size > HUGE)
        if not garbage.any():
            continue
        first, most = int(np.argmax(garbage)), garbage.mean() > _MOSTLY
        inspection.warn(
            f"{inspection.named(column)}, row {inspection.row(first)}:"
            f" {values[first]:.3g} is no measurement but uninitialised memory"
            f" ({int(garbage.sum())} such values);{' the column is' if most else ''} left out"
        )
        inspection.set(column, np.where(garbage | most, np.nan, values))
    joints = "torque_command" if inspection.metadata.onboard == "torque" else "position_command"
    for column in (*MEASURED, *PAIRS[joints]):
        values = inspection.floats(column)
        if np.isnan(values).all() or np.nanmax(np.abs(values)) > 0:
            continue
        sentence = f"{inspection.named(column)} is zero in all rows from {inspection.row(0)} on"
        if column in MEASURED:
            inspection.warn(f"{sentence}: not recorded, left out")
            inspection.set(column, np.full_like(values, np.nan))
        else:  # a command may well be zero
            inspection.warn(f"{sentence}: kept as a command of zero")


def _drop_startup(inspection: Inspection) -> None:
    known, already = inspection.metadata.startup_rows, inspection.row(0)
    if known and already:
        return  # saved again after they were left out
    rows, reason = max(
        (min(known, inspection.table.height), "the rig's start-up"),
        (_asleep(inspection), "all joints read zero, then jump"),
        key=lambda found: found[0],
    )
    if rows:
        pairs = PAIRS["torque_command"] + PAIRS["position"]
        present = [c for c in pairs if c in inspection.table.columns]
        inspection.warn(
            f"rows {already} to {inspection.row(rows - 1)} are start-up rows ({reason};"
            f" {', '.join(map(inspection.named, present[:2]))}); left out"
        )
    inspection.table = inspection.table.slice(rows)


def _asleep(inspection: Inspection) -> int:
    """Return the rows before the sensors woke up."""
    q = np.stack([inspection.floats(c) for c in PAIRS["position"]], axis=-1)
    awake = np.flatnonzero((np.nan_to_num(q) != 0).any(axis=-1))
    if not len(awake) or awake[0] == 0 or awake[0] > len(q) // 2:
        return 0
    return int(awake[0]) if np.nanmax(np.abs(q[awake[0]])) > _JUMP else 0


def _align_commands(inspection: Inspection) -> None:
    """Put each command beside the state before it acted; the last row's is unknown."""
    if inspection.metadata.sample == "before-command":
        return
    inspection.metadata = replace(inspection.metadata, sample="before-command")
    commands = [c for q in PAIRS if q.endswith("_command") for c in PAIRS[q]]
    commands += [*PAIRS["stiffness"], *PAIRS["damping"]]
    later = [pl.col(c).shift(-1) for c in commands if c in inspection.table.columns]
    inspection.table = inspection.table.with_columns(later)[:-1]


def _check_motion(inspection: Inspection) -> None:
    spans = {}
    for column in PAIRS["position"]:
        values = inspection.floats(column)
        known = np.count_nonzero(~np.isnan(values))
        if known >= _LEAST_ROWS:
            spans[column] = float(np.nanmax(values) - np.nanmin(values))
        elif not known:
            inspection.warn(f"{inspection.named(column)} was not recorded")
    origin = inspection.origin
    if not spans:
        raise RecordingError(
            f"{origin} is too short: {inspection.table.height} rows, and no joint has {_LEAST_ROWS}"
            f" positions ({' or '.join(map(inspection.named, PAIRS['position']))})."
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


_TURN = 2 * np.pi
_NEAR = 0.02  # s, within which no joint turns by half a turn
_QUICK = 50.0  # speed that a joint may have while its angle wraps, rad/s
_SHORT = 3  # rows that a spike lasts at most
_FAR = {"position": (0.1, 4.0), "velocity": (3.0, 8.0)}
"""How far a spike leads at least, SI, and in units of what nearly no row steps by."""
_LEAP = 0.3  # rad, less than which no jump is sure
_OUTSIDE = 0.2  # rad beyond a mechanical stop that a recording may show: stops and belts give way


def _steps(inspection: Inspection, column: str) -> tuple[IntArray, Array, Array]:
    """Return rows with a value, and the steps and times from one to the next."""
    values = inspection.floats(column)
    known = np.flatnonzero(~np.isnan(values))
    return known, np.diff(values[known]), np.diff(inspection.floats("time_s")[known])


def _mend_angles(inspection: Inspection) -> None:
    """Let wrapped angles go on; leave out what leads far away and back at once."""
    for column in (*PAIRS["position"], *PAIRS["position_command"]):
        known, steps, times = _steps(inspection, column)
        turns = np.where(times < _NEAR, np.round(steps / _TURN), 0.0)
        turns[np.abs(steps - turns * _TURN) > 0.05 + _QUICK * times] = 0.0
        if turns.any():
            values = inspection.floats(column)
            values[known[1:]] -= _TURN * np.cumsum(turns)
            inspection.set(column, values)
            inspection.warn(
                f"{inspection.named(column)} wraps {np.count_nonzero(turns)} times, first before"
                f" row {inspection.row(known[np.argmax(turns != 0) + 1])}; it was made to go on"
            )
    for quantity in _FAR:
        for column in PAIRS[quantity]:
            _drop_spikes(inspection, column, *_FAR[quantity])


def _drop_spikes(inspection: Inspection, column: str, least: float, often: float) -> None:
    known, steps, times = _steps(inspection, column)
    if len(known) < _LEAST_ROWS:
        return
    far = max(least, often * float(np.quantile(np.abs(steps), 0.98)))
    near = np.append(times < 2 * np.median(np.diff(inspection.floats("time_s"))), False)
    values = inspection.floats(column)
    seen, out = values[known], list[int]()
    for leap in np.flatnonzero(np.abs(steps) > far).tolist():
        if out and leap <= out[-1]:
            continue
        for last in range(leap + 1, min(leap + 1 + _SHORT, len(seen) - 1)):
            away = np.abs(seen[leap + 1 : last + 1] - seen[leap])
            if abs(seen[last + 1] - seen[leap]) < away.min() / 2 and near[leap : last + 1].all():
                out += range(leap + 1, last + 1)
                break
    if out:
        rows = ", ".join(str(inspection.row(row)) for row in known[out[:5]])
        inspection.warn(
            f"{inspection.named(column)} leads far away and back at once in {len(out)} rows"
            f" ({rows}{', ...' if len(out) > 5 else ''}): spikes, left out"
        )
        values[known[out]] = np.nan
        inspection.set(column, values)


def _check_angles(inspection: Inspection) -> None:
    """Refuse angles that jump, or are beyond the robot's mechanical stops."""
    for name, column in zip(JOINTS, PAIRS["position"], strict=True):
        known, steps, times = _steps(inspection, column)
        leaps = np.flatnonzero(np.abs(steps) > np.maximum(_LEAP, FASTEST * times))
        if len(leaps):
            inspection.refuse(
                f"{inspection.named(column)} jumps by {steps[leaps[0]]:.3g} rad before row"
                f" {inspection.row(known[leaps[0] + 1])} ({len(leaps)} such jumps): its counter"
                " wraps, or the encoder lost its place; make it go on, or split the file there."
            )
        if (robot := inspection.robot) is None:
            continue
        joint_of, q = getattr(robot, name), inspection.floats(column)
        low, high = joint_of.stop_lower - _OUTSIDE, joint_of.stop_upper + _OUTSIDE
        beyond = np.flatnonzero((q < low) | (q > high))
        if len(beyond) and high - low < _TURN:
            inspection.refuse(
                f"{inspection.named(column)} is {q[beyond[0]]:.3g} rad in row"
                f" {inspection.row(beyond[0])}, but the {name} of '{robot.name}' ends at"
                f" {joint_of.stop_lower:g} and {joint_of.stop_upper:g}; is its sign or zero"
                " another, or is it another robot's?"
            )
