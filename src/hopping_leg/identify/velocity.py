"""A velocity must be the derivative of its position."""

from dataclasses import dataclass

import numpy as np
import polars as pl

from hopping_leg.arrays import Array
from hopping_leg.errors import RecordingError
from hopping_leg.identify.columns import PAIRS
from hopping_leg.identify.inspection import Inspection
from hopping_leg.identify.units import DEGREE, TURN, unit_of

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


def check_velocity(inspection: Inspection) -> pl.DataFrame:
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
            inspection.table = inspection.without(moving)
    return inspection.table


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
