"""Angles that jump, sensors that stand still, angles that cannot be this leg's."""

import numpy as np

from hopping_leg.arrays import Array, IntArray
from hopping_leg.identify.recording_format import PAIRS
from hopping_leg.identify.unit_checks import FASTEST, Inspection
from hopping_leg.robot import JOINTS

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
_OUTSIDE = 0.1  # rad beyond a mechanical stop that a recording may show
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
