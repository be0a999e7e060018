"""What the loader refuses: time that runs backwards, numbers in other units than SI.

Rows in messages are those of the file, the first below the header being 0.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import polars as pl

from hopping_leg.arrays import Array
from hopping_leg.errors import RecordingError, RobotError
from hopping_leg.identify.recording_format import JOINTS, PAIRS, RecordingMetadata
from hopping_leg.robot import load_robot


@dataclass
class Inspection:
    """What the checks know.

    Attributes:
        table: In a recording's columns and types; null where nothing was recorded.
        metadata: How it was recorded.
        origin: The file, for messages.
        names: The file's own column for a recording's column, where they differ.
        warnings: What was strange so far, a sentence each.
    """

    table: pl.DataFrame
    metadata: RecordingMetadata
    origin: str
    names: Mapping[str, str] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)

    def named(self, column: str) -> str:
        """Return a column as the file calls it, in quotes."""
        own = self.names.get(column, column)
        return f"column '{own}'" if own == column else f"column '{own}' ({column})"

    def row(self, index: int) -> int:
        """Return the file's row of a row of the table."""
        return int(self.table["row"][int(index)]) if "row" in self.table.columns else index

    def values(self, column: str) -> pl.Series:
        """Return a column, all null if there is none."""
        if column in self.table.columns:
            return self.table[column]
        return pl.Series(column, [None] * self.table.height, dtype=pl.Float64)

    def floats(self, column: str) -> Array:
        """Return a column as floats, (ticks,), NaN where null."""
        values: Array = self.values(column).cast(pl.Float64).to_numpy()
        return np.asarray(values, dtype=np.float64)

    def warn(self, sentence: str) -> None:
        """Note something strange; the sentence gets the file and a full stop."""
        self.warnings.append(f"{self.origin}: {sentence}.")

    def drop(self, column: str) -> None:
        """Make a column as if it had not been recorded."""
        empty = pl.lit(None, dtype=self.table[column].dtype).alias(column)
        self.table = self.table.with_columns(empty)


STALL = 2.0
"""A gap between rows of more than this many periods is a stall."""

_UNITS = {"ms": 1e3, "us": 1e6, "ns": 1e9, "min": 1 / 60}
_SPARSEST = 20.0
"""Periods per row beyond which the rate or the time's unit must be wrong."""


def row_period(time: np.ndarray, period: float) -> float:
    """Return the usual time from row to row, s: the nominal period, or more in a sparse log."""
    return max(period, float(np.median(np.diff(time)))) if len(time) > 1 else period


def check_clock(inspection: Inspection) -> None:
    """Refuse time that is missing, not finite, not increasing or in another unit.

    Raises:
        RecordingError: Naming file, column and row.
    """
    time, where = inspection.floats("time_s"), inspection.named("time_s")
    bad = np.flatnonzero(~np.isfinite(time))
    if len(bad):
        raise RecordingError(
            f"{inspection.origin}: {where} has no time in row {inspection.row(bad[0])};"
            " every row needs one."
        )
    steps = np.diff(time)
    back = np.flatnonzero(steps <= 0)
    if len(back):
        index = back[0] + 1
        raise RecordingError(
            f"{inspection.origin}: {where} does not increase in row {inspection.row(index)}:"
            f" {time[index]:.9g} s comes after {time[index - 1]:.9g} s; remove the row."
        )
    if len(steps):
        _check_unit(inspection, float(np.median(steps)))


def _check_unit(inspection: Inspection, step: float) -> None:
    periods = step * inspection.metadata.rate_hz
    if 0.5 <= periods <= _SPARSEST:
        return
    unit = next((u for u, f in _UNITS.items() if 0.8 < periods / f < 1.25), None)
    guess = f"the time seems to be in {unit}" if unit else "one of the two is wrong"
    raise RecordingError(
        f"{inspection.origin}: {inspection.named('time_s')} steps by {step:.3g} from row to row"
        f" but the metadata's rate_hz = {inspection.metadata.rate_hz:g} means"
        f" {inspection.metadata.period:.3g} s; {guess}."
    )


DEGREE, TURN = 180 / np.pi, 1 / (2 * np.pi)
"""What a rad is in degrees and in revolutions."""

_WIDEST = 25.0
"""Span of a joint, rad, four turns; degrees exceed it."""

_FASTEST = 150.0
"""Speed of a joint, rad/s, far beyond any leg's motor; degrees per second exceed it."""

_HIGHEST = 5.0
"""Base height, m; millimetres exceed it."""

_STRONGEST = 5.0
"""Torque in units of the motor's peak; mN m exceed it."""

_COMMON_PEAK = 60.0
"""Peak torque where the robot is unknown, N m."""

_TOLERANCE = 0.1


def unit_of(factor: float, units: dict[str, float]) -> str | None:
    """Return the unit whose factor to SI is the given one, if any."""
    return next((u for u, f in units.items() if abs(factor / f - 1) < _TOLERANCE), None)


def check_units(inspection: Inspection) -> None:
    """Refuse positions, speeds, torques and heights that cannot be rad, rad/s, N m and m.

    Raises:
        RecordingError: Naming file, column and row.
    """
    for quantity in ("position", "position_command"):
        for column in PAIRS[quantity]:
            values = inspection.floats(column)
            _at_most(inspection, column, values - _middle(values), _WIDEST / 2, "rad", "degrees")
    for quantity in ("velocity", "velocity_command"):
        for column in PAIRS[quantity]:
            _at_most(inspection, column, inspection.floats(column), _FASTEST, "rad/s", "degrees/s")
    peaks = _peak_torques(inspection)
    for quantity in ("torque", "torque_command"):
        for column, peak in zip(PAIRS[quantity], peaks, strict=True):
            limit = _STRONGEST * peak
            _at_most(inspection, column, inspection.floats(column), limit, "N m", "mN m")
    for column in ("height_m", "base_rise_m"):
        _at_most(inspection, column, inspection.floats(column), _HIGHEST, "m", "mm")
    for measured, commanded in zip(PAIRS["position"], PAIRS["position_command"], strict=True):
        _compare(inspection, measured, commanded)


def _middle(values: Array) -> float:
    known = values[~np.isnan(values)]
    return float(known.max() + known.min()) / 2 if len(known) else 0.0


def _at_most(
    inspection: Inspection, column: str, values: Array, limit: float, unit: str, guess: str
) -> None:
    size = np.abs(values)
    if np.isnan(size).all() or np.nanmax(size) <= limit:
        return
    worst = int(np.nanargmax(size))
    value = inspection.floats(column)[worst]
    raise RecordingError(
        f"{inspection.origin}: {inspection.named(column)} cannot be in {unit}: row"
        f" {inspection.row(worst)} holds {value:.4g}; is it in {guess}? Convert it."
    )


def _peak_torques(inspection: Inspection) -> list[float]:
    try:
        robot = load_robot(inspection.metadata.robot)
    except (RobotError, OSError):
        return [_COMMON_PEAK for _ in JOINTS]
    return [j.motor.peak_torque * j.belt_ratio for j in (robot.hip, robot.knee)]


def _compare(inspection: Inspection, measured: str, commanded: str) -> None:
    """Refuse a position that follows its command in another unit."""
    q, command = inspection.floats(measured), inspection.floats(commanded)
    known = ~np.isnan(q + command)
    if known.sum() < 20:
        return
    q, command = q[known], command[known]
    q, command = q - q.mean(), command - command.mean()
    power = float(command @ command)
    size = float(np.sqrt(power * (q @ q)))
    if size == 0 or float(q @ command) / size < 0.9:
        return
    factor = float(q @ command) / power
    unit = unit_of(factor, {"degrees": DEGREE, "revolutions": TURN})
    unit, column = (
        unit or unit_of(1 / factor, {"degrees": DEGREE, "revolutions": TURN}),
        (measured if unit else commanded),
    )
    if unit:
        first = inspection.row(int(np.argmax(known)))
        raise RecordingError(
            f"{inspection.origin}: {inspection.named(column)} seems to be in {unit} from row"
            f" {first} on: position over command is {factor:.3g}; convert it to rad."
        )


BLOCK = 0.05
"""Time over which velocity is integrated and compared with the way, s; shorter blocks would
compare the position's quantisation."""

_LEAST_BLOCKS = 20
_LEAST_WAY = 5e-3
"""Root mean square way within a block below which nothing can be said, rad."""

_GAP = 0.2
"""Longest time between two velocities that is integrated across, s."""

_DENSE = 0.9
"""Share of rows with a velocity above which interpolation plays no role."""

_POSITION_UNITS = {"degrees": DEGREE, "revolutions": TURN}
_VELOCITY_UNITS = {"degrees/s": 1 / DEGREE, "revolutions/s": 1 / TURN, "rpm": 1 / TURN / 60}


@dataclass(frozen=True)
class Agreement:
    """How the way compares with the integral of velocity.

    Attributes:
        factor: Way over integral.
        correlation: Of the two.
        worst: Index of the row that ends the block where they differ most.
    """

    factor: float
    correlation: float
    worst: int


def check_velocity(inspection: Inspection) -> None:
    """Leave out a velocity that is not the derivative of its position.

    Raises:
        RecordingError: Position or velocity is in another unit; names file, column and row.
    """
    time = inspection.floats("time_s")
    for placed, moving in zip(PAIRS["position"], PAIRS["velocity"], strict=True):
        velocity = inspection.floats(moving)
        agreement = compare(time, inspection.floats(placed), velocity)
        if agreement is None:
            continue
        _refuse_unit(inspection, placed, moving, agreement)
        dense = np.mean(~np.isnan(velocity)) > _DENSE
        tolerance, least = (0.1, 0.97) if dense else (0.3, 0.9)
        if abs(agreement.factor - 1) > tolerance or agreement.correlation < least:
            inspection.warn(
                f"{inspection.named(moving)} is not the derivative of"
                f" {inspection.named(placed)}, most in row {inspection.row(agreement.worst)}"
                f" (way over integral {agreement.factor:.3g}, correlation"
                f" {agreement.correlation:.2f}); left out"
            )
            inspection.drop(moving)


def _refuse_unit(inspection: Inspection, placed: str, moving: str, agreement: Agreement) -> None:
    if agreement.correlation < 0.9:
        return
    for column, units in ((placed, _POSITION_UNITS), (moving, _VELOCITY_UNITS)):
        unit = unit_of(agreement.factor, units)
        if unit:
            raise RecordingError(
                f"{inspection.origin}: {inspection.named(column)} seems to be in {unit}: in"
                f" {BLOCK * 1e3:g} ms, position moves {agreement.factor:.3g} times the integral of"
                f" velocity, most in row {inspection.row(agreement.worst)}; convert to rad and"
                " rad/s."
            )


def compare(time: Array, position: Array, velocity: Array) -> Agreement | None:
    """Compare a position with its velocity, or return none where they cannot tell.

    Args:
        time: (ticks,), s.
        position: (ticks,), rad; NaN where not measured.
        velocity: (ticks,), rad/s; NaN where not measured.
    """
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
    late = np.searchsorted(time[placed], time[placed] + BLOCK)
    early = np.flatnonzero(late < len(placed))
    late = late[early]
    same = (runs[late] == runs[early]) & (time[placed][late] - time[placed][early] < 2 * BLOCK)
    begin, end = placed[early[same]], placed[late[same]]
    if len(begin) < _LEAST_BLOCKS:
        return None
    integral, actual = way[end] - way[begin], position[end] - position[begin]
    power = float(integral @ integral)
    if power == 0 or np.sqrt(np.mean(actual**2)) < _LEAST_WAY:
        return None
    factor = float(integral @ actual) / power
    size = float(np.sqrt(power * (actual @ actual)))
    worst = int(end[np.argmax(np.abs(actual - integral))])
    return Agreement(factor, float(integral @ actual) / size, worst)
