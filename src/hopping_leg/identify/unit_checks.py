"""What the loader knows of a table, and what it refuses: numbers in other units than SI.

Rows in messages are those of the file, the first below the header being 0.
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
    """What the checks know."""

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
        kept = pl.Series(column, values).fill_nan(None)
        self.table = self.table.with_columns(kept)

    def drop(self, column: str) -> None:
        """Make a column as if it had not been recorded."""
        self.table = self.table.with_columns(pl.lit(None, self.table[column].dtype).alias(column))


STALL = 2.0
"""A gap between rows of more than this many periods is a stall."""
_DEGREE, _TURN = 180 / np.pi, 1 / (2 * np.pi)
_POSITION_UNITS = {"degrees": _DEGREE, "revolutions": _TURN}
_VELOCITY_UNITS = {"degrees/s": 1 / _DEGREE, "revolutions/s": 1 / _TURN, "rpm": 1 / _TURN / 60}
_HALF_TURNS = 12.5  # largest distance of a joint from its middle, rad, two turns; degrees exceed it
FASTEST = 150.0
"""Speed of a joint, rad/s, far beyond any leg's motor; degrees per second exceed it."""
_HIGHEST = 5.0  # base height, m; millimetres exceed it
_STRONGEST = 5.0  # torque in units of the motor's peak; mN m exceed it
_COMMON_PEAK = 60.0  # peak torque where the robot is unknown, N m
_BLOCK = 0.05  # integration of velocity, s; shorter blocks would compare quantisation
_LEAST_BLOCKS = 20
_LEAST_WAY = 5e-3  # root mean square way within a block below which nothing can be said, rad
_GAP = 0.2  # longest time between two velocities that is integrated across, s
_DENSE = 0.9  # share of rows with a velocity above which interpolation plays no role
_ALIKE = 0.9  # correlation above which two columns are one quantity, maybe in two units


def row_period(time: np.ndarray, period: float) -> float:
    """Return the usual time from row to row, s: the nominal period, or more in a sparse log."""
    return max(period, float(np.median(np.diff(time)))) if len(time) > 1 else period


def check_units(inspection: Inspection) -> None:
    """Refuse positions, speeds, torques and heights that cannot be rad, rad/s, N m and m."""
    strongest, robot = [_COMMON_PEAK] * 2, inspection.robot
    if robot is not None:
        strongest = [j.motor.peak_torque * j.belt_ratio for j in (robot.hip, robot.knee)]
    joints = (
        ("position", [_HALF_TURNS] * 2, "rad", "degrees"),
        ("velocity", [FASTEST] * 2, "rad/s", "degrees/s"),
        ("torque", [_STRONGEST * peak for peak in strongest], "N m", "mN m"),
    )
    for quantity, limits, unit, guess in joints:
        for columns in (PAIRS[quantity], PAIRS[f"{quantity}_command"]):
            for column, limit in zip(columns, limits, strict=True):
                _check_size(inspection, column, limit, unit, guess, quantity == "position")
    for column in ("height_m", "base_rise_m"):
        _check_size(inspection, column, _HIGHEST, "m", "mm")
    for measured, commanded in zip(PAIRS["position"], PAIRS["position_command"], strict=True):
        _check_command(inspection, measured, commanded)


def _check_size(
    inspection: Inspection, column: str, limit: float, unit: str, guess: str, centred: bool = False
) -> None:
    values = inspection.floats(column)
    if np.isnan(values).all():
        return
    middle = float(np.nanmax(values) + np.nanmin(values)) / 2 if centred else 0.0
    worst = int(np.nanargmax(np.abs(values - middle)))
    if abs(values[worst] - middle) > limit:
        inspection.refuse(
            f"{inspection.named(column)} cannot be in {unit}: row {inspection.row(worst)} holds"
            f" {values[worst]:.4g}; is it in {guess}? Convert it."
        )


def _check_command(inspection: Inspection, measured: str, commanded: str) -> None:
    """Refuse a position that follows its command in another unit."""
    q, command = inspection.floats(measured), inspection.floats(commanded)
    known = ~np.isnan(q + command)
    if known.sum() < 20:
        return
    q, command = q[known], command[known]
    factor, correlation = _proportion(command - command.mean(), q - q.mean()) or (1.0, 0.0)
    if correlation < _ALIKE:
        return
    for column, ratio in ((measured, factor), (commanded, 1 / factor)):
        unit = _unit_of(ratio, _POSITION_UNITS)
        if unit:
            inspection.refuse(
                f"{inspection.named(column)} seems to be in {unit} from row"
                f" {inspection.row(int(np.argmax(known)))} on: position over command is"
                f" {factor:.3g}; convert it to rad."
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
    time = inspection.floats("time_s")
    for placed, moving in zip(PAIRS["position"], PAIRS["velocity"], strict=True):
        velocity = inspection.floats(moving)
        compared = _compare(time, inspection.floats(placed), velocity)
        if compared is None:
            continue
        factor, correlation, worst = compared[0], compared[1], inspection.row(compared[2])
        for column, units in ((placed, _POSITION_UNITS), (moving, _VELOCITY_UNITS)):
            unit = _unit_of(factor, units)
            if unit and correlation >= _ALIKE:
                inspection.refuse(
                    f"{inspection.named(column)} seems to be in {unit}: in {_BLOCK * 1e3:g} ms,"
                    f" position moves {factor:.3g} times the integral of velocity, most in row"
                    f" {worst}; convert to rad and rad/s."
                )
        dense = np.mean(~np.isnan(velocity)) > _DENSE
        tolerance, least = (0.1, 0.97) if dense else (0.3, 0.9)
        if abs(factor - 1) > tolerance or correlation < least:
            inspection.warn(
                f"{inspection.named(moving)} is not the derivative of"
                f" {inspection.named(placed)}, most in row {worst} (way over integral"
                f" {factor:.3g}, correlation {correlation:.2f}); left out"
            )
            inspection.drop(moving)


def _compare(time: Array, position: Array, velocity: Array) -> tuple[float, float, int] | None:
    """Return way over integral, their correlation and the worst row; None if nothing tells."""
    moving = np.flatnonzero(~np.isnan(velocity))
    placed = np.flatnonzero(~np.isnan(position))
    if len(moving) < 2 or len(placed) < 2:
        return None
    placed = placed[(placed >= moving[0]) & (placed <= moving[-1])]
    if len(placed) < 2:
        return None
    filled = np.interp(time, time[moving], velocity[moving])
    steps = np.diff(time)
    way = np.append(0.0, np.cumsum((filled[1:] + filled[:-1]) / 2 * steps))
    run = np.append(0, np.cumsum(np.diff(time[moving]) > _GAP))
    runs = run[np.searchsorted(moving, placed, side="right") - 1]
    late = np.searchsorted(time[placed], time[placed] + _BLOCK)
    early = np.flatnonzero(late < len(placed))
    late = late[early]
    same = (runs[late] == runs[early]) & (time[placed][late] - time[placed][early] < 2 * _BLOCK)
    begin, end = placed[early[same]], placed[late[same]]
    if len(begin) < _LEAST_BLOCKS:
        return None
    integral, actual = way[end] - way[begin], position[end] - position[begin]
    proportion = _proportion(integral, actual)
    if proportion is None or np.sqrt(np.mean(actual**2)) < _LEAST_WAY:
        return None
    worst = int(end[np.argmax(np.abs(actual - integral))])
    return *proportion, worst
