"""What the loader rejects, and what it mends or leaves out and warns about.

A check raises, or changes the inspection's table to what can be believed. A stated PD says what
every row's torque must be, k (q* - q) + d (q'* - q') + feed-forward: measured torque over it is 1
where all is right, and its correlation is highest at the right row.
"""

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NoReturn

import numpy as np
import polars as pl
from scipy import ndimage

from hopping_leg.arrays import Array, IntArray
from hopping_leg.errors import RecordingError, RobotError
from hopping_leg.identify.recording_format import MEASURED, PAIRS, RecordingMetadata, float_column
from hopping_leg.robot import JOINTS, Robot, load_robot

_FASTEST = 150.0  # rad/s, far beyond any leg's motor; degrees per second exceed it
_TURN = 2 * np.pi


@dataclass
class Inspection:
    """What the checks know; rows in messages are those of the file, from 0 on."""

    table: pl.DataFrame
    """In a recording's columns and types; null where nothing was recorded."""
    metadata: RecordingMetadata
    origin: str
    """The file, for messages."""
    warnings: list[str] = field(default_factory=list)
    """What was strange so far, a sentence each."""

    @cached_property
    def robot(self) -> Robot | None:
        """The robot that the recording is filed under, None if it is not here."""
        try:
            return load_robot(self.metadata.robot)
        except (RobotError, OSError):
            return None

    def row(self, index: int) -> int:
        """Return the file's row of a row of the table."""
        return int(self.table["row"][int(index)]) if "row" in self.table.columns else int(index)

    def floats(self, column: str) -> Array:
        """Return a column as floats, (ticks,), NaN where null."""
        return float_column(self.table, column)

    def refuse(self, sentence: str) -> NoReturn:
        """Refuse the file."""
        raise RecordingError(f"{self.origin}: {sentence}.")

    def warn(self, sentence: str) -> None:
        """Note something strange."""
        self.warnings.append(f"{self.origin}: {sentence}.")

    def mend(self, column: str, values: Array, sentence: str) -> None:
        """Give a column other values, (ticks,), NaN for nothing, and say why."""
        self.warn(f"column '{column}' {sentence}")
        self.table = self.table.with_columns(pl.Series(column, values).fill_nan(None))


def check_table(inspection: Inspection) -> None:
    """Leave what can be believed in the table, warn of the rest, or raise RecordingError."""
    if inspection.table.height == 0:
        inspection.refuse("there are no rows below its header; record again")
    if "time_s" not in inspection.table.columns:
        names = ", ".join(name for name in inspection.table.columns if name != "row")
        inspection.refuse(
            f"there is no column 'time_s' among {names}; a recording needs time and position: name"
            " their columns in the sidecar's table [columns]"
        )
    _check_clock(inspection)
    _drop_garbage(inspection)
    _drop_startup(inspection)
    _align_commands(inspection)
    _unwrap_angles(inspection)
    for quantity in _FAR:
        for column in PAIRS[quantity]:
            _drop_spikes(inspection, column, *_FAR[quantity])
    _check_sizes(inspection)
    _check_motion(inspection)
    _check_jumps(inspection)
    _check_signs(inspection)
    for joint, columns in enumerate(zip(PAIRS["position"], PAIRS["velocity"], strict=True)):
        _check_velocity(inspection, *columns)
        _check_torque(inspection, joint)
    _warn_of_stalls(inspection)


_STALL = 2.0  # periods between rows from which on rows are missing
_SPARSEST = 20.0  # periods per row beyond which the rate or the time's unit must be wrong
# Where counters of nanoseconds to seconds begin anew, and the time of day, s
_COUNTERS = [2.0**bits * 10.0**-n for bits in (16, 24, 31, 32) for n in (9, 6, 3, 0)] + [86400.0]
_SOON = 5.0  # usual steps within which a wrapped clock goes on
_UNSORTED = 0.4  # share of steps back in time that no counter makes
_ALIKE = 0.01  # periods within which two steps are one
_COARSE = 0.3  # periods that a clock's tick may last


def stalls(time: Array, period: float) -> IntArray:
    """Return the rows after which rows are missing; a sparse log's usual step is its period, s."""
    steps = np.diff(time)
    usual = max(period, float(np.median(steps))) if len(steps) else period
    return np.flatnonzero(steps > _STALL * usual)


def _check_clock(inspection: Inspection) -> None:
    """Refuse time that is missing, not increasing, too coarse or in another unit."""
    time = inspection.floats("time_s")
    if len(bad := np.flatnonzero(~np.isfinite(time))):
        inspection.refuse(f"column 'time_s' has no time in row {inspection.row(bad[0])}")
    if np.sum(np.diff(time) < 0) > _UNSORTED * len(time):
        inspection.refuse("its rows are not in the order of time; sort them by column 'time_s'")
    _unwrap_time(inspection, time)
    steps, metadata = np.diff(time), inspection.metadata
    if not len(steps):
        return
    tick = _tick(steps, metadata.period)
    if tick > _COARSE * metadata.period:
        inspection.refuse(
            f"column 'time_s' is too coarse: it counts in {tick * 1e3:.4g} ms, where a row takes"
            f" {metadata.period * 1e3:.4g}; record it to a tenth of that"
        )
    if len(back := np.flatnonzero(steps <= 0)):
        before, after = time[back[0] : back[0] + 2]
        inspection.refuse(
            f"column 'time_s' does not increase in row {inspection.row(back[0] + 1)}:"
            f" {after:.9g} s comes after {before:.9g} s; delete that row, or split the file there"
        )
    step = float(np.median(steps))
    if not 0.5 <= step * metadata.rate_hz <= _SPARSEST:
        over = round(math.log10(step * metadata.rate_hz))
        unit = {3: " (in ms?)", 6: " (in us?)", 9: " (in ns?)"}.get(over, "")
        inspection.refuse(
            f"column 'time_s' steps by {step:.3g}{unit} from row to row but the metadata's rate_hz"
            f" = {metadata.rate_hz:g} means {metadata.period:.3g} s; one of the two is wrong"
        )


def _unwrap_time(inspection: Inspection, time: Array) -> None:
    """Let time, (ticks,), go on where its counter began anew."""
    steps = np.diff(time)
    usual = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    wraps = 0
    for index in np.flatnonzero(steps < 0).tolist():
        turn = next((c for c in _COUNTERS if 0 < steps[index] + c < _SOON * usual), 0.0)
        time[index + 1 :] += turn
        wraps += turn > 0
    if wraps:
        inspection.mend("time_s", time, f"began anew {wraps} times; it was made to go on")


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
    time = inspection.floats("time_s")
    found, steps = stalls(time, inspection.metadata.period), np.diff(time)
    if len(found):
        worst = int(found[np.argmax(steps[found])])
        inspection.warn(
            f"column 'time_s': stall of {steps[worst] * 1e3:.1f} ms before row"
            f" {inspection.row(worst + 1)}, the longest of {len(found)}"
        )


_TINY, _HUGE = 1e-30, 1e30  # uninitialised memory read as a float is beyond, no sensor's value is
_WOKEN = 0.05  # step out of rows of zeros, rad, that only a sensor that woke up makes


def _drop_garbage(inspection: Inspection) -> None:
    """Leave out uninitialised memory, and measured columns that are zero throughout."""
    for column in inspection.table.select(pl.selectors.float()).columns:
        values = inspection.floats(column)
        size = np.abs(values)
        garbage = ((size > 0) & (size < _TINY)) | (size > _HUGE)
        if garbage.any():
            values[garbage] = np.nan
            first = inspection.row(int(np.argmax(garbage)))
            said = f"holds uninitialised memory in {garbage.sum()} rows, first in row {first}"
            inspection.mend(column, values, f"{said}; left out")
        if column in MEASURED and not np.nan_to_num(values).any() and (values == 0).any():
            inspection.mend(column, np.nan * values, "is zero in all rows: left out")


def _drop_startup(inspection: Inspection) -> None:
    """Leave out the rows before commands were applied, or before the sensors woke up."""
    known, already = inspection.metadata.startup_rows, inspection.row(0)
    if known and already:
        return  # saved again after they were left out
    q = np.stack([inspection.floats(c) for c in PAIRS["position"]], axis=-1)
    awake = int(np.argmax((np.nan_to_num(q) != 0).any(axis=-1)))
    asleep = awake if awake <= len(q) // 2 and np.abs(q[awake]).max(initial=0) > _WOKEN else 0
    rows = max(min(known, len(q)), asleep)
    if rows:
        inspection.warn(
            f"rows {already} to {inspection.row(rows - 1)} are start-up rows"
            f" ({'all joints read zero, then jump' if asleep > known else 'as stated'}); left out"
        )
        inspection.table = inspection.table.slice(rows)


def _align_commands(inspection: Inspection) -> None:
    """Put each command beside the state before it acted; the last row's is unknown."""
    if inspection.metadata.sample == "after-command":
        inspection.metadata = replace(inspection.metadata, sample="before-command")
        names = [q for q in PAIRS if q.endswith("_command")] + ["stiffness", "damping"]
        present = [c for q in names for c in PAIRS[q] if c in inspection.table.columns]
        inspection.table = inspection.table.with_columns(pl.col(present).shift(-1))[:-1]


_LEAST_ROWS = 20  # rows with a position that a recording needs
_LEAST_MOTION = 0.02  # motion of the joint that moves more, rad; below it nothing can be identified


def _check_motion(inspection: Inspection) -> None:
    """Refuse recordings that are too short or at rest."""
    known = {c: v[~np.isnan(v)] for c in PAIRS["position"] for v in [inspection.floats(c)]}
    spans = {c: float(np.ptp(values)) for c, values in known.items() if len(values) >= _LEAST_ROWS}
    if not spans:
        inspection.refuse(
            f"it is too short: {inspection.table.height} rows, and no joint has {_LEAST_ROWS}"
            f" values of {' or '.join(PAIRS['position'])}"
        )
    widest = max(spans, key=spans.__getitem__)
    if spans[widest] < _LEAST_MOTION:
        inspection.refuse(f"the leg is at rest: column '{widest}' spans {spans[widest]:.2g} rad")


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


def _unwrap_angles(inspection: Inspection) -> None:
    """Let wrapped angles go on."""
    for column in (*PAIRS["position"], *PAIRS["position_command"]):
        known, steps, times = _steps(inspection, column)
        turns = np.where(times < _NEAR, np.round(steps / _TURN), 0.0)
        turns[np.abs(steps - turns * _TURN) > 0.05 + _QUICK * times] = 0.0
        if turns.any():
            values = inspection.floats(column)
            values[known[1:]] -= _TURN * np.cumsum(turns)
            first = inspection.row(known[np.argmax(turns != 0) + 1])
            said = f"wraps {np.count_nonzero(turns)} times, first before row {first}"
            inspection.mend(column, values, f"{said}; it was made to go on")


def _drop_spikes(inspection: Inspection, column: str, least: float, often: float) -> None:
    """Leave out what leads far away and back at once."""
    known, steps, times = _steps(inspection, column)
    if len(known) < _LEAST_ROWS:
        return
    far = max(least, often * float(np.quantile(np.abs(steps), 0.98)))
    values, around = inspection.floats(column), 2 * _SHORT + 1
    seen = values[known]
    lasts = ndimage.maximum_filter1d(np.append(times, 0.0), around, mode="nearest")
    near = lasts < 2 * np.median(np.diff(inspection.floats("time_s")))
    leads = np.abs(seen - ndimage.median_filter(seen, around, mode="nearest")) > far
    out = known[leads & near]
    if len(out):
        values[out] = np.nan
        rows = ", ".join([str(inspection.row(row)) for row in out[:5]] + ["..."] * (len(out) > 5))
        said = f"leads far away and back at once in {len(out)} rows ({rows}): spikes, left out"
        inspection.mend(column, values, said)


def _check_jumps(inspection: Inspection) -> None:
    """Refuse angles that jump, or are beyond the robot's mechanical stops."""
    for name, column in zip(JOINTS, PAIRS["position"], strict=True):
        known, steps, times = _steps(inspection, column)
        jumps = np.abs(steps) > np.maximum(_LEAP, _FASTEST * times)
        if len(leaps := np.flatnonzero(jumps)):
            inspection.refuse(
                f"column '{column}' jumps by {steps[leaps[0]]:.3g} rad before row"
                f" {inspection.row(known[leaps[0] + 1])} ({len(leaps)} such jumps); make it go on,"
                " or split the file there"
            )
        if (robot := inspection.robot) is None:
            continue
        joint, q = getattr(robot, name), inspection.floats(column)
        low, high = joint.stop_lower - _OUTSIDE, joint.stop_upper + _OUTSIDE
        beyond = np.flatnonzero((q < low) | (q > high))
        if len(beyond) and high - low < _TURN:
            inspection.refuse(
                f"column '{column}' is {q[beyond[0]]:.3g} rad in row"
                f" {inspection.row(beyond[0])}, but the {name} of '{robot.name}' ends at"
                f" {joint.stop_lower:g} and {joint.stop_upper:g}; check sign, zero and robot"
            )


def _check_signs(inspection: Inspection) -> None:
    """Refuse a standing leg one of whose joints has another sign; doubt a mirrored one."""
    robot, columns = inspection.robot, PAIRS["position"]
    if robot is None or inspection.metadata.rig == "fixed-base":
        return
    about = [float(np.nanmedian([*inspection.floats(c), np.nan])) for c in columns]
    signs = np.sign(about) * np.sign([j.lower + j.upper for j in (robot.hip, robot.knee)])
    said = f"columns {' and '.join(columns)} are about {about[0]:.3g} and {about[1]:.3g} rad,"
    if signs.prod() < 0:
        inspection.refuse(
            f"{said} which no standing '{robot.name}' has: change the sign of one of the joints, of"
            " its velocity, torque and commands, too"
        )
    if (signs < 0).all():
        inspection.warn(f"{said} as a mirrored '{robot.name}' stands; check both joints' signs")


_COMMON_PEAK = 60.0  # peak torque where the robot is unknown, N m
_FARTHEST = 12.5  # two turns from the middle, rad
_HIGHEST = 5.0  # base height, m; millimetres exceed it


def _check_sizes(inspection: Inspection) -> None:
    """Refuse positions, speeds, torques and heights that cannot be rad, rad/s, N m and m."""
    peaks = [_COMMON_PEAK] * 2
    if (robot := inspection.robot) is not None:
        peaks = [j.motor.peak_torque * j.belt_ratio for j in (robot.hip, robot.knee)]
    columns = {"height_m": (_HIGHEST, "m", "mm"), "base_rise_m": (_HIGHEST, "m", "mm")}
    for joint, peak in enumerate(peaks):
        for kind in ("", "_command"):
            columns[PAIRS[f"position{kind}"][joint]] = (_FARTHEST, "rad", "degrees")
            columns[PAIRS[f"velocity{kind}"][joint]] = (_FASTEST, "rad/s", "degrees/s")
            columns[PAIRS[f"torque{kind}"][joint]] = (5.0 * peak, "N m", "mN m")
    for column, (most, unit, guess) in columns.items():
        values = inspection.floats(column)
        if np.isnan(values).all():
            continue
        middle = (np.nanmax(values) + np.nanmin(values)) / 2 if unit == "rad" else 0.0
        worst = int(np.nanargmax(np.abs(values - middle)))
        if abs(values[worst] - middle) > most:
            inspection.refuse(
                f"column '{column}' cannot be in {unit}: row {inspection.row(worst)} holds"
                f" {values[worst]:.4g}; is it in {guess}? Convert it"
            )


_LIKE = 0.9  # correlation above which a velocity is the derivative, maybe in another unit
_OFF = 0.25  # share by which it may be another all the same: sparse logs are interpolated
_OTHER_UNIT = 3.0  # factor that degrees, revolutions and rpm are all beyond
_BLOCK = 0.05  # integration of velocity, s; shorter blocks would compare quantisation
_LEAST_BLOCKS = 20
_LEAST_WAY = 5e-3  # root mean square way within a block below which nothing can be said, rad


def _check_velocity(inspection: Inspection, placed: str, moving: str) -> None:
    """Leave out a velocity that is not the derivative of its position; refuse other units."""
    time, position, velocity = map(inspection.floats, ("time_s", placed, moving))
    moves, known = (np.flatnonzero(~np.isnan(v)) for v in (velocity, position))
    if min(len(moves), len(known)) < 2:
        return
    filled = np.interp(time, time[moves], velocity[moves])
    integral = np.append(0.0, np.cumsum((filled[1:] + filled[:-1]) / 2 * np.diff(time)))
    starts = np.arange(time[moves[0]], time[moves[-1]], _BLOCK)
    edges = known[np.unique(np.searchsorted(time[known], starts).clip(max=len(known) - 1))]
    whole = (np.diff(time[edges]) < 2 * _BLOCK) & (np.diff(np.searchsorted(moves, edges)) > 0)
    way, expected = np.diff(position[edges])[whole], np.diff(integral[edges])[whole]
    if len(way) < _LEAST_BLOCKS or np.sqrt(np.mean(way**2)) < _LEAST_WAY or not expected.any():
        return
    both, power = float(way @ expected), float(expected @ expected)
    factor, alike = both / power, both / float(np.sqrt(power * (way @ way)))
    found = f"(way over integral {factor:.3g}, correlation {alike:.2f})"
    if alike >= _LIKE and not 1 / _OTHER_UNIT < factor < _OTHER_UNIT:
        inspection.refuse(
            f"column '{placed}' or column '{moving}' seems to be in degrees,"
            f" revolutions or rpm {found}; convert to rad and rad/s"
        )
    if abs(factor - 1) > _OFF or alike < _LIKE:
        said = f"is not the derivative of column '{placed}' {found}; left out"
        inspection.mend(moving, np.nan * velocity, said)


_LEAST_TORQUES = 50
_LEAST_TORQUE = 0.1  # rms, N m, of what is asked for, below which noise rules
_ALIKE_TORQUE, _STRANGE, _OPPOSED = 0.9, 0.6, -0.5
"""Correlations from which on torques are one, and up to which they are strangers or opposed."""
_CLEARER = 0.5  # share of what a row leaves unexplained that another one must stay below
_LATEST = 10  # rows by which torques are searched for
_TOO_LATE = 0.02  # s, longer than any drive takes
_RATIOS = {False: (0.75, 1.33), True: (0.4, 2.5)}
"""Measured torque over what a stated PD asks for, or, true, a torque command."""


def _check_torque(inspection: Inspection, joint: int) -> None:
    """Refuse a torque that contradicts what was asked for; doubt one that comes late."""
    metadata, named = inspection.metadata, f"column '{PAIRS['torque'][joint]}'"
    commanded = metadata.onboard == "torque"
    right = 1 if metadata.onboard == "zoh" else 0
    asked, measured = _asked(inspection, joint), inspection.floats(PAIRS["torque"][joint])
    rows = {late: _compare(asked, measured, late) for late in range(-1, _LATEST)}
    found = {late: pair for late, pair in rows.items() if pair is not None}
    if right not in found:
        return
    best = max(found, key=lambda late: abs(found[late][1]))
    ((least, most), correlation), own = found[best], found[right][1]
    if correlation < _OPPOSED:
        inspection.refuse(
            f"{named} has the opposite sign of what was asked for (correlation {correlation:.2f});"
            " a positive torque accelerates towards positive angles"
        )
    exact, (low, high) = commanded or metadata.gains_exact, _RATIOS[commanded]
    if exact and correlation > _ALIKE_TORQUE and not (least < high and most > low):
        inspection.refuse(
            f"{named} is {np.sqrt(abs(least * most)):.3g} times what was asked for, maybe in"
            " amperes, at the motor's side of a gear or belt, or with other gains; give all of"
            " them in N m at the joint"
        )
    if commanded or not exact:
        return
    if correlation < _STRANGE:
        inspection.refuse(
            f"{named} does not follow the stated PD (correlation {correlation:.2f}); check"
            " 'stiffness', 'damping', 'onboard', 'sample' and the columns"
        )
    late = best - right
    if late and 1 - correlation**2 < _CLEARER * (1 - own**2):
        sentence = (
            f"{named} follows the stated PD {'late' if late > 0 else 'early'}, by"
            f" {abs(late) * metadata.period * 1e3:.3g} ms or {abs(late)} of its rows"
            f" (correlation {correlation:.3f}, {own:.3f} at its own row); move the column"
        )
        if late < 0 or late * metadata.period >= _TOO_LATE:
            inspection.refuse(f"{sentence}, or check 'sample' and 'onboard'")
        inspection.warn(f"{sentence} unless the drives take that long")


def _asked(inspection: Inspection, joint: int) -> Array:
    """Return the torque that every row's state and command ask for, (ticks,), NaN if unknown."""
    metadata = inspection.metadata

    def column(name: str) -> Array:
        return inspection.floats(PAIRS[name][joint])

    if metadata.onboard == "torque":
        return column("torque_command")
    stiffness, damping = (
        np.where(np.isnan(column(name)), (pair or (np.nan, np.nan))[joint], column(name))
        for name, pair in (("stiffness", metadata.stiffness), ("damping", metadata.damping))
    )
    rate, forward = (np.nan_to_num(column(f"{name}_command")) for name in ("velocity", "torque"))
    position = column("position_command")
    if metadata.onboard == "continuous":  # a row's torque is from its state and the last command
        position, rate, forward = (np.append(np.nan, v[:-1]) for v in (position, rate, forward))
    asked: Array = stiffness * (position - column("position")) + forward
    return asked + damping * (rate - column("velocity"))


def _compare(asked: Array, measured: Array, late: int) -> tuple[tuple[float, float], float] | None:
    """Return measured over asked, least and most, and their correlation at rows that are late.

    Errors of what is asked for pull its regression towards zero, those of what is measured the
    inverse one away from it: the truth is between.
    """
    x = asked[max(-late, 0) : len(asked) - max(late, 0)]
    y = measured[max(late, 0) : len(measured) - max(-late, 0)]
    known = ~np.isnan(x + y)
    x, y = x[known], y[known]
    if len(x) < _LEAST_TORQUES or np.sqrt(np.mean(x**2)) < _LEAST_TORQUE or not y.any():
        return None
    small = np.abs(x) <= np.median(np.abs(x))  # larger ones may be beyond what a motor gives
    asked_power, both, power = x[small] @ x[small], x[small] @ y[small], y[small] @ y[small]
    least = float(both / max(asked_power, 1e-12))
    most = float(power / both) if both > 0 else least
    return (least, most), float(x @ y) / float(np.sqrt((x @ x) * (y @ y)))
