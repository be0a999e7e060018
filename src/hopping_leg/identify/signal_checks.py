"""Signals by themselves: clocks, sensors that stand still, angles that jump or no leg has."""

import numpy as np

from hopping_leg.arrays import Array, IntArray
from hopping_leg.identify.recording_format import PAIRS
from hopping_leg.identify.unit_checks import FASTEST, Inspection
from hopping_leg.robot import JOINTS

_TIME_UNITS = {"ms": 1e3, "us": 1e6, "ns": 1e9, "min": 1 / 60}
_SPARSEST = 20.0  # periods per row beyond which the rate or the time's unit must be wrong
_COUNTERS = [2.0**bits * unit for bits in (16, 24, 31, 32) for unit in (1e-9, 1e-6, 1e-3, 1.0)] + [
    86400.0
]
"""Where counters of nanoseconds to seconds begin anew, and the time of day, s."""
_SOON = 5.0  # usual steps within which a wrapped clock goes on
_ALIKE = 0.01  # periods within which two steps are one
_COARSE, _USELESS = 0.15, 0.3  # periods that a clock's tick may last: with a warning, and at all


def check_clock(inspection: Inspection) -> None:
    """Refuse time that is missing, not finite, not increasing, too coarse or in another unit.

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


_TURN = 2 * np.pi
_NEAR = 0.02  # s, within which no joint turns by half a turn
_FAST = 50.0  # speed that a joint may have while its angle wraps, rad/s
_SHORT = 3  # rows that a spike lasts at most
_FAR = {"position": (0.1, 4.0), "velocity": (3.0, 8.0)}
"""How far a spike leads at least, SI, and in units of what nearly no row steps by."""
_LEAP = 0.3  # rad, less than which no jump is sure
_STILL = 20, 0.2  # rows and s; shorter stretches may repeat a value
_MOVED = {"position": 0.1, "velocity": 1.0, "torque": 0.5}
"""Range, SI, of one quantity over a stretch that makes another, which repeats its value, stale."""
_WITNESSES = {
    "position": ("position_command", "velocity"),
    "velocity": ("position", "position_command"),
    "torque": ("torque_command", "position_command"),
}
"""What moves with a quantity."""
_OUTSIDE = 0.2  # rad beyond a mechanical stop that a recording may show: stops and belts give way
_BENT = 0.2  # rad, from which on a joint is bent to one side


def drop_spikes(inspection: Inspection) -> None:
    """Let wrapped angles go on; leave out what leads far away and back at once."""
    for column in (*PAIRS["position"], *PAIRS["position_command"]):
        _unwrap(inspection, column)
    for quantity in _FAR:
        for column in PAIRS[quantity]:
            _drop_spikes(inspection, column, *_FAR[quantity])


def check_steadiness(inspection: Inspection) -> None:
    """Leave out stretches in which a sensor stood still; refuse angles that jump."""
    for quantity in _WITNESSES:
        for joint in range(2):
            _drop_stale(inspection, quantity, joint)
    for column in PAIRS["position"]:
        known, steps, times = _steps(inspection, column)
        leaps = np.flatnonzero(np.abs(steps) > np.maximum(_LEAP, FASTEST * times))
        if len(leaps):
            inspection.refuse(
                f"{inspection.named(column)} jumps by {steps[leaps[0]]:.3g} rad before row"
                f" {inspection.row(known[leaps[0] + 1])} ({len(leaps)} such jumps): its counter"
                " wraps, or the encoder lost its place; make it go on, or split the file there."
            )


def _steps(inspection: Inspection, column: str) -> tuple[IntArray, Array, Array]:
    """Return rows with a value, and the steps and times from one to the next."""
    values = inspection.floats(column)
    known = np.flatnonzero(~np.isnan(values))
    return known, np.diff(values[known]), np.diff(inspection.floats("time_s")[known])


def _unwrap(inspection: Inspection, column: str) -> None:
    known, steps, times = _steps(inspection, column)
    turns = np.where(times < _NEAR, np.round(steps / _TURN), 0.0)
    turns[np.abs(steps - turns * _TURN) > 0.05 + _FAST * times] = 0.0
    wraps = np.flatnonzero(turns)
    if len(wraps):
        values = inspection.floats(column)
        values[known[1:]] -= _TURN * np.cumsum(turns)
        inspection.set(column, values)
        inspection.warn(
            f"{inspection.named(column)} wraps {len(wraps)} times, first before row"
            f" {inspection.row(known[wraps[0] + 1])}; it was made to go on"
        )


def _drop_spikes(inspection: Inspection, column: str, least: float, often: float) -> None:
    known, steps, times = _steps(inspection, column)
    if len(known) < _STILL[0]:
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


def _drop_stale(inspection: Inspection, quantity: str, joint: int) -> None:
    """Leave out stretches of one value throughout while what must move with it moves."""
    column, time = PAIRS[quantity][joint], inspection.floats("time_s")
    values, largest = inspection.floats(column), np.inf
    if quantity == "torque":  # a motor at its limit gives the same all the time
        largest = np.nanmax(np.abs(values), initial=0.0)
    changes = np.flatnonzero(np.diff(values) != 0) + 1
    for first, stop in zip([0, *changes], [*changes, len(values)], strict=True):
        last = stop - 1
        short = stop - first < _STILL[0] or time[last] - time[first] < _STILL[1]
        if short or np.isnan(values[first]) or abs(values[first]) >= largest:
            continue
        for name in _WITNESSES[quantity]:
            seen = inspection.floats(PAIRS[name][joint])[first:stop]
            seen = seen[~np.isnan(seen)]
            if len(seen) and np.ptp(seen) > _MOVED[name.removesuffix("_command")]:
                inspection.warn(
                    f"{inspection.named(column)} repeats one value from row"
                    f" {inspection.row(first)} to {inspection.row(last)} while"
                    f" {inspection.named(PAIRS[name][joint])} moves: stale, left out"
                )
                values[first:stop] = np.nan
                inspection.set(column, values)
                break


def check_posture(inspection: Inspection) -> None:
    """Refuse angles beyond mechanical stops; doubt those that a leg hardly has."""
    if (robot := inspection.robot) is None:
        return
    columns = PAIRS["position"]
    angles = [inspection.floats(column) for column in columns]
    for name, column, q in zip(JOINTS, columns, angles, strict=True):
        joint = getattr(robot, name)
        low, high = joint.stop_lower - _OUTSIDE, joint.stop_upper + _OUTSIDE
        beyond = np.flatnonzero((q < low) | (q > high))
        if len(beyond) and high - low < _TURN:
            inspection.refuse(
                f"{inspection.named(column)} is {q[beyond[0]]:.3g} rad in row"
                f" {inspection.row(beyond[0])}, but the {name} of '{robot.name}' ends at"
                f" {joint.stop_lower:g} and {joint.stop_upper:g}; is its sign or zero another, or"
                " is it another robot's?"
            )
    if robot.kind != "leg" or any(np.isnan(q).all() for q in angles):
        return
    hip, knee = (float(np.nanmedian(q)) for q in angles)
    hip -= _TURN * round(hip / _TURN)
    down = robot.thigh.length * np.cos(hip) + robot.shank.length * np.cos(hip + knee)
    if hip * knee > 0 and min(abs(hip), abs(knee)) > _BENT:
        inspection.warn(
            f"{inspection.named(columns[1])} bends to the same side as the hip (medians"
            f" {knee:.2g} and {hip:.2g} rad), where a leg's knee bends back; check both signs"
        )
    elif down < _BENT * robot.thigh.length:
        inspection.warn(
            f"{inspection.named(columns[0])} holds the foot {down:.2g} m below the hip in the"
            " median; check that 0 is the thigh straight down"
        )
