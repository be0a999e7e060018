"""Numbers in other units or with other signs than SI at the joint; velocities that are none.

A stated PD says what every row's torque must be: k (q* - q) + d (q'* - q') + feed-forward. The
measured torque over it is 1 where all is right, -1 where the sign is another, 1/b or 1/b^2 where
it is that of the motor's side of a belt with ratio b; its correlation is highest at the right row.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import NoReturn

import numpy as np
import polars as pl

from hopping_leg.arrays import Array
from hopping_leg.errors import RecordingError, RobotError
from hopping_leg.identify.recording_format import PAIRS, RecordingMetadata, float_column
from hopping_leg.robot import Robot, load_robot


@dataclass
class Inspection:
    """What the checks know; rows in messages are those of the file, the first of data being 0."""

    table: pl.DataFrame
    """In a recording's columns and types; null where nothing was recorded."""
    metadata: RecordingMetadata
    origin: str
    """The file, for messages."""
    names: Mapping[str, str]
    """The file's own column for a recording's column, where they differ."""
    warnings: list[str] = field(default_factory=list)
    """What was strange so far, a sentence each."""

    @cached_property
    def robot(self) -> Robot | None:
        """The robot that the recording is filed under, None if it is not here."""
        try:
            return load_robot(self.metadata.robot)
        except (RobotError, OSError):
            return None

    def named(self, column: str) -> str:
        """Return a column as the file calls it, in quotes."""
        own = self.names.get(column, column)
        return f"column '{own}'" if own == column else f"column '{own}' ({column})"

    def row(self, index: int) -> int:
        """Return the file's row of a row of the table."""
        return int(self.table["row"][int(index)]) if "row" in self.table.columns else index

    def floats(self, column: str) -> Array:
        """Return a column as floats, (ticks,), NaN where null."""
        return float_column(self.table, column)

    def refuse(self, sentence: str) -> NoReturn:
        """Refuse the file; the sentence has its full stop."""
        raise RecordingError(f"{self.origin}: {sentence}")

    def warn(self, sentence: str) -> None:
        """Note something strange; the sentence gets the file and a full stop."""
        self.warnings.append(f"{self.origin}: {sentence}.")

    def set(self, column: str, values: Array) -> None:
        """Give a column other values, (ticks,); NaN stands for nothing."""
        self.table = self.table.with_columns(pl.Series(column, values).fill_nan(None))


_DEGREE, _TURN = 180 / np.pi, 2 * np.pi
_POSITION_UNITS = {"degrees": _DEGREE, "revolutions": 1 / _TURN}
_VELOCITY_UNITS = {"degrees/s": 1 / _DEGREE, "revolutions/s": _TURN, "rpm": _TURN / 60}
FASTEST = 150.0
"""Speed of a joint, rad/s, far beyond any leg's motor; degrees per second exceed it."""
_COMMON_PEAK = 60.0  # peak torque where the robot is unknown, N m
_SIZES = (
    ("position", 12.5, "rad", "degrees"),  # two turns from the middle
    ("velocity", FASTEST, "rad/s", "degrees/s"),
    ("torque", 5.0, "N m", "mN m"),  # times the motor's peak
)
"""Quantities with the largest magnitude they have in their unit, and what exceeds it."""
_HIGHEST = 5.0  # base height, m; millimetres exceed it
_LIKE = 0.9  # correlation above which a velocity is the derivative, maybe in another unit
_OFF = 0.25  # share by which it may be another all the same: sparse logs are interpolated
_BLOCK = 0.05  # integration of velocity, s; shorter blocks would compare quantisation
_LEAST_BLOCKS = 20
_LEAST_WAY = 5e-3  # root mean square way within a block below which nothing can be said, rad
_GAP = 0.2  # longest time between two velocities that is integrated across, s


def check_units(inspection: Inspection) -> None:
    """Refuse positions, speeds, torques and heights that cannot be rad, rad/s, N m and m."""
    peaks, robot = [_COMMON_PEAK] * 2, inspection.robot
    if robot is not None:
        peaks = [j.motor.peak_torque * j.belt_ratio for j in (robot.hip, robot.knee)]
    for quantity, most, unit, guess in _SIZES:
        for columns in (PAIRS[quantity], PAIRS[f"{quantity}_command"]):
            for column, peak in zip(columns, peaks, strict=True):
                limit = most * peak if quantity == "torque" else most
                _check_size(inspection, column, limit, unit, guess)
    for column in ("height_m", "base_rise_m"):
        _check_size(inspection, column, _HIGHEST, "m", "mm")


def _check_size(inspection: Inspection, column: str, limit: float, unit: str, guess: str) -> None:
    values = inspection.floats(column)
    if np.isnan(values).all():
        return
    middle = (np.nanmax(values) + np.nanmin(values)) / 2 if unit == "rad" else 0.0
    worst = int(np.nanargmax(np.abs(values - middle)))
    if abs(values[worst] - middle) > limit:
        inspection.refuse(
            f"{inspection.named(column)} cannot be in {unit}: row {inspection.row(worst)} holds"
            f" {values[worst]:.4g}; is it in {guess}? Convert it."
        )


def _unit_of(factor: float, units: dict[str, float]) -> str | None:
    return next((u for u, f in units.items() if abs(factor / f - 1) < 0.1), None)


def _proportion(x: Array, y: Array) -> tuple[float, float] | None:
    """Return the factor from x to y and how they correlate; none if one of them is zero."""
    power, product = float(x @ x), float(x @ y)
    size = float(np.sqrt(power * (y @ y)))
    return (product / power, product / size) if size else None


def check_velocity(inspection: Inspection) -> None:
    """Leave out a velocity that is not the derivative of its position; refuse other units."""
    for placed, moving in zip(PAIRS["position"], PAIRS["velocity"], strict=True):
        compared = _way_over_integral(inspection, placed, moving)
        if compared is None:
            continue
        factor, alike, worst = compared
        for column, units in ((placed, _POSITION_UNITS), (moving, _VELOCITY_UNITS)):
            if alike >= _LIKE and (unit := _unit_of(factor, units)):
                inspection.refuse(
                    f"{inspection.named(column)} seems to be in {unit}: in {_BLOCK * 1e3:g} ms,"
                    f" position moves {factor:.3g} times the integral of velocity, most in row"
                    f" {worst}; convert to rad and rad/s."
                )
        if abs(factor - 1) > _OFF or alike < _LIKE:
            inspection.warn(
                f"{inspection.named(moving)} is not the derivative of"
                f" {inspection.named(placed)}, most in row {worst} (way over integral"
                f" {factor:.3g}, correlation {alike:.2f}); left out"
            )
            inspection.set(moving, np.full(inspection.table.height, np.nan))


def _way_over_integral(
    inspection: Inspection, placed: str, moving: str
) -> tuple[float, float, int] | None:
    """Return way over integral, their correlation and the worst row; None if nothing tells."""
    time, position, velocity = map(inspection.floats, ("time_s", placed, moving))
    moves = np.flatnonzero(~np.isnan(velocity))
    if len(moves) < 2:
        return None
    filled = np.interp(time, time[moves], velocity[moves])
    integral = np.append(0.0, np.cumsum((filled[1:] + filled[:-1]) / 2 * np.diff(time)))
    runs = np.append(0, np.cumsum(np.diff(time[moves]) > _GAP))
    known = np.flatnonzero(~np.isnan(position))
    known = known[(known >= moves[0]) & (known <= moves[-1])]
    run = runs[np.searchsorted(moves, known, side="right") - 1]
    late = np.searchsorted(time[known], time[known] + _BLOCK)
    early = np.flatnonzero(late < len(known))
    late = late[early]
    whole = (run[late] == run[early]) & (time[known[late]] - time[known[early]] < 2 * _BLOCK)
    begin, end = known[early[whole]], known[late[whole]]
    way, expected = position[end] - position[begin], integral[end] - integral[begin]
    if len(way) < _LEAST_BLOCKS or np.sqrt(np.mean(way**2)) < _LEAST_WAY:
        return None
    found = _proportion(expected, way)
    return found and (*found, inspection.row(end[np.argmax(np.abs(way - expected))]))


_LEAST_ROWS = 50
_LEAST_TORQUE = 0.1  # rms, N m, of what is asked for, below which noise rules
_ALIKE, _STRANGE, _OPPOSED = 0.9, 0.6, -0.5
"""Correlations from which on torques are one, and up to which they are strangers or opposed."""
_CLEARER = 0.5  # share of what a row leaves unexplained that another one must stay below
_LATEST = 10  # rows by which torques are searched for
_TOO_LATE = 0.02  # s, longer than any drive takes
_RATIOS = {False: (0.75, 1.33), True: (0.4, 2.5)}
"""Measured torque over what a stated PD asks for, or, true, a torque command."""
_SAME = 0.05  # within which a factor is a gear's or a belt's


def check_torque(inspection: Inspection) -> None:
    """Refuse torques that contradict what was asked for; doubt rows that come late."""
    metadata = inspection.metadata
    commanded = metadata.onboard == "torque"
    right = 1 if metadata.onboard == "zoh" else 0
    for joint, column in enumerate(PAIRS["torque"]):
        asked, measured = _asked(inspection, joint), inspection.floats(column)
        rows = {late: _compare(asked, measured, late) for late in range(-1, _LATEST)}
        found = {late: pair for late, pair in rows.items() if pair is not None}
        if right not in found:
            continue
        best = max(found, key=lambda late: abs(found[late][1]))
        (slopes, correlation), own = found[best], found[right][1]
        named, late = inspection.named(column), best - right
        if correlation < _OPPOSED:
            inspection.refuse(
                f"{named} has the opposite sign of what was asked for (correlation"
                f" {correlation:.2f}); a positive torque accelerates towards positive angles, turn"
                " its sign round."
            )
        exact, (low, high) = commanded or metadata.gains_exact, _RATIOS[commanded]
        if exact and correlation > _ALIKE and not (slopes[0] < high and slopes[1] > low):
            slope = float(np.sqrt(abs(slopes[0] * slopes[1])))
            inspection.refuse(
                f"{named} is {slope:.3g} times what was asked for"
                f"{_side(inspection.robot, joint, slope)}; give torques in N m at the joint, and"
                " gains likewise."
            )
        if commanded or not exact:
            continue
        if correlation < _STRANGE:
            inspection.refuse(
                f"{named} does not follow the stated PD (correlation {correlation:.2f}); check"
                " 'stiffness', 'damping', 'onboard', 'sample' and the columns."
            )
        if late and 1 - correlation**2 < _CLEARER * (1 - own**2):
            sentence = (
                f"{named} follows the stated PD {'late' if late > 0 else 'early'}, by"
                f" {abs(late) * metadata.period * 1e3:.3g} ms or {abs(late)} of its rows"
                f" (correlation {correlation:.3f}, {own:.3f} at its own row); move the column"
            )
            if late < 0 or late * metadata.period >= _TOO_LATE:
                inspection.refuse(f"{sentence}, or check 'sample' and 'onboard'.")
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
    if len(x) < _LEAST_ROWS or np.sqrt(np.mean(x**2)) < _LEAST_TORQUE or not y.any():
        return None
    small = np.abs(x) <= np.median(np.abs(x))  # larger ones may be beyond what a motor gives
    asked_power, both, power = x[small] @ x[small], x[small] @ y[small], y[small] @ y[small]
    least = float(both / max(asked_power, 1e-12))
    most = float(power / both) if both > 0 else least
    return (least, most), float(x @ y) / float(np.sqrt((x @ x) * (y @ y)))


def _side(robot: Robot | None, joint: int, slope: float) -> str:
    """Return the likely reason for a factor, as part of a sentence."""
    if robot is not None:
        one = (robot.hip, robot.knee)[joint]
        belt, gear = one.belt_ratio, one.motor.gear_ratio
        for side, factors in (
            ("the motor's side of the belt", (1 / belt, 1 / belt**2)),
            ("the rotor", (1 / gear, 1 / (gear * belt))),
        ):
            if any(abs(slope / factor - 1) < _SAME for factor in factors):
                return f", as if at {side}"
    return ", maybe in amperes or with other gains"
