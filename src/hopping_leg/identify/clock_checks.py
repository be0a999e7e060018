"""Time stamps: missing, running backwards, wrapped, too coarse, in another unit."""

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.identify.unit_checks import Inspection

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
    _unwrap(inspection, time)
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


def _unwrap(inspection: Inspection, time: Array) -> None:
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


def _tick(steps: Array, period: float) -> float:
    """Return what a clock counts in, s, where rows are no whole number of that apart, else 0."""
    sizes = np.unique(steps / period)
    sizes = sizes[np.append(True, np.diff(sizes) > _ALIKE)]
    tick = float(np.diff(sizes).min(initial=np.inf))
    counts = np.append(sizes, 1.0) / tick
    odd = np.abs(counts - np.rint(counts))
    counted = np.isfinite(tick) and sizes[0] >= 0 and odd[:-1].max() < 0.1
    return tick * period if counted and (odd[-1] > 2 * _ALIKE or sizes[0] == 0 < tick - 1) else 0.0
