"""Signals between rows: commands as functions of time, and ticks of a simulation at the rows."""

from collections.abc import Sequence

import numpy as np

from hopping_leg.arrays import Array


class HeldSignal:
    """Values that hold or ramp from their row to the next, averaged over any interval.

    The average is exact for jittered time stamps, s, (rows,), and differentiable in the interval's
    position, and so in a delay. Values and slopes, their rates of change from each row on, are
    (rows, k); before the first row and after the last the values hold.
    """

    def __init__(self, time: Array, values: Array, slopes: Array | None = None) -> None:
        self._time, self._values = time, values
        self._slopes = np.zeros_like(values) if slopes is None else slopes.copy()
        self._slopes[-1] = 0.0
        step = np.diff(time)[:, None]
        area = step * (values[:-1] + 0.5 * step * self._slopes[:-1])
        self._integral = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(area, axis=0)])

    def average(self, start: Array, duration: float) -> Array:
        """Return the mean from absolute times ``start``, s, (...), on, (..., k)."""
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
        return self._integral[row] + since * (self._values[row] + 0.5 * since * slope)


class RowResampling:
    """Where the rows of every window lie among the ticks.

    Values at the ticks have shape (ticks, hypotheses, windows, k), those at the rows
    (hypotheses, windows, rows, k). Windows with fewer rows than the longest repeat their last;
    ``padding``, (windows, rows), says where.

    Args:
        times: Times of each window's rows since its first, s, (rows of that window,).
        tick: Time between two ticks, s.
    """

    def __init__(self, times: Sequence[Array], tick: float) -> None:
        length = max(map(len, times))
        filled = np.zeros((len(times), length))
        self.padding = np.ones((len(times), length), dtype=bool)
        for i, rows in enumerate(times):
            filled[i, : len(rows)], filled[i, len(rows) :] = rows, rows[-1]
            self.padding[i, : len(rows)] = False
        place = filled / tick
        self.ticks = int(np.ceil(place.max() - 1e-6)) + 2
        self._tick = tick
        self._before = np.minimum(np.floor(place + 1e-9).astype(int), self.ticks - 2)
        self._share = np.clip(place - self._before, 0.0, 1.0)[..., None]

    def cubic(self, q: Array, qd: Array) -> tuple[Array, Array]:
        """Return position, rad, and velocity, rad/s, by the cubic through both at the ticks."""
        q0, q1 = self._ends(q)
        v0, v1 = (self._tick * v for v in self._ends(qd))
        s, jump = self._share, q1 - q0
        square, cube = 3 * jump - 2 * v0 - v1, v0 + v1 - 2 * jump
        position = q0 + s * (v0 + s * (square + s * cube))
        velocity = (v0 + s * (2 * square + s * 3 * cube)) / self._tick
        return position, velocity

    def linear(self, values: Array) -> Array:
        """Return values at the rows, on the straight line between the ticks around each."""
        before, after = self._ends(values)
        return np.asarray(before + self._share * (after - before))

    def _ends(self, values: Array) -> tuple[Array, Array]:
        """Return what stands at the ticks around each row, (hypotheses, windows, rows, k)."""
        windows = np.arange(len(self._before))[:, None]
        moved = np.moveaxis(values, 0, 2)
        return moved[:, windows, self._before], moved[:, windows, self._before + 1]
