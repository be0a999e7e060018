"""Recorded rows as functions of time: each row's value holds, or ramps, until the next row."""

import numpy as np

from hopping_leg.arrays import Array


class HeldSignal:
    """Values that hold or ramp from their row to the next, averaged over any interval.

    The average is exact for jittered time stamps and differentiable in the interval's position,
    and so in a delay.

    Args:
        time: Time stamps, s, (rows,).
        values: At the rows, (rows, k); before the first row and after the last they hold.
        slopes: Rates of change from each row on, (rows, k); zero if None.
    """

    def __init__(self, time: Array, values: Array, slopes: Array | None = None) -> None:
        self._time, self._values = time, values
        self._slopes = np.zeros_like(values) if slopes is None else slopes.copy()
        self._slopes[-1] = 0.0
        step = np.diff(time)[:, None]
        area = step * (values[:-1] + 0.5 * step * self._slopes[:-1])
        self._integral = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(area, axis=0)])

    def average(self, start: Array, duration: float) -> Array:
        """Return the mean over ``start`` to ``start + duration``, (..., k).

        Args:
            start: Absolute times, s, (...).
            duration: s.
        """
        return (self._until(start + duration) - self._until(start)) / duration

    def at(self, time: Array) -> Array:
        """Return the values in force at absolute times, (..., k); ``time`` is (...)."""
        row = np.searchsorted(self._time, time, side="right") - 1
        return self._values[np.clip(row, 0, len(self._time) - 1)]

    def _until(self, time: Array) -> Array:
        """Return the integral from the first row to ``time``, (..., k)."""
        row = np.clip(np.searchsorted(self._time, time, side="right") - 1, 0, len(self._time) - 1)
        since = (time - self._time[row])[..., None]
        slope = np.where(since < 0, 0.0, self._slopes[row])
        area: Array = self._integral[row] + since * (self._values[row] + 0.5 * since * slope)
        return area
