"""Recorded rows as functions of time: each row's value holds until the next row."""

import numpy as np

from hopping_leg.arrays import Array


class Held:
    """Values that hold from their row to the next, averaged over any interval.

    The average is exact for jittered time stamps and differentiable in the interval's position,
    and so in a delay.

    Args:
        time: Time stamps, s, (rows,).
        values: Columns, (rows, k); before the first row the first holds, after the last the last.
    """

    def __init__(self, time: Array, values: Array) -> None:
        self._first, self._last = time[0], time[-1]
        self._time, self._values = time, values
        area = np.diff(time)[:, None] * values[:-1]
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
        return self._integral[row] + (time - self._time[row])[..., None] * self._values[row]
