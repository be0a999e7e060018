"""Numbers too large or in too odd a proportion to be SI."""

import numpy as np
import polars as pl

from hopping_leg.arrays import Array
from hopping_leg.errors import RecordingError, RobotError
from hopping_leg.identify.columns import JOINTS, PAIRS
from hopping_leg.identify.inspection import Inspection
from hopping_leg.robot import load_robot

DEGREE, TURN = 180 / np.pi, 1 / (2 * np.pi)
"""What a rad is in degrees and in revolutions."""

WIDEST = 25.0
"""Span of a joint, rad, four turns; degrees exceed it."""

FASTEST = 150.0
"""Speed of a joint, rad/s, far beyond any leg's motor; degrees per second exceed it."""

HIGHEST = 5.0
"""Base height, m; millimetres exceed it."""

_STRONGEST = 5.0
"""Torque in units of the motor's peak; mN m exceed it."""

_COMMON_PEAK = 60.0
"""Peak torque where the robot is unknown, N m."""

_TOLERANCE = 0.1


def unit_of(factor: float, units: dict[str, float]) -> str | None:
    """Return the unit whose factor to SI is the given one, if any."""
    return next((u for u, f in units.items() if abs(factor / f - 1) < _TOLERANCE), None)


def check_units(inspection: Inspection) -> pl.DataFrame:
    """Refuse positions, speeds, torques and heights that cannot be rad, rad/s, N m and m.

    Raises:
        RecordingError: Naming file, column and row.
    """
    for quantity in ("position", "position_command"):
        for column in PAIRS[quantity]:
            values = inspection.floats(column)
            _at_most(inspection, column, values - _middle(values), WIDEST / 2, "rad", "degrees")
    for quantity in ("velocity", "velocity_command"):
        for column in PAIRS[quantity]:
            _at_most(inspection, column, inspection.floats(column), FASTEST, "rad/s", "degrees/s")
    peaks = _peak_torques(inspection)
    for quantity in ("torque", "torque_command"):
        for column, peak in zip(PAIRS[quantity], peaks, strict=True):
            limit = _STRONGEST * peak
            _at_most(inspection, column, inspection.floats(column), limit, "N m", "mN m")
    for column in ("height_m", "base_rise_m"):
        _at_most(inspection, column, inspection.floats(column), HIGHEST, "m", "mm")
    for measured, commanded in zip(PAIRS["position"], PAIRS["position_command"], strict=True):
        _compare(inspection, measured, commanded)
    return inspection.table


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
