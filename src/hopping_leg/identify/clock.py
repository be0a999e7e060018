"""Time stamps: jitter is normal, running backwards is not."""

import numpy as np
import polars as pl

from hopping_leg.errors import RecordingError
from hopping_leg.identify.inspection import Inspection

STALL = 2.0
"""A gap between rows of more than this many periods is a stall."""

_UNITS = {"ms": 1e3, "us": 1e6, "ns": 1e9, "min": 1 / 60}
_SPARSEST = 20.0
"""Periods per row beyond which the rate or the time's unit must be wrong."""


def row_period(time: np.ndarray, period: float) -> float:
    """Return the usual time from row to row, s: the nominal period, or more in a sparse log."""
    return max(period, float(np.median(np.diff(time)))) if len(time) > 1 else period


def check_clock(inspection: Inspection) -> pl.DataFrame:
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
    return inspection.table


def warn_of_stalls(inspection: Inspection) -> pl.DataFrame:
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
    return inspection.table


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
