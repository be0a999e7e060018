"""Recorded rows among the ticks of a simulation: values at the ticks become values at the rows."""

from collections.abc import Sequence

import numpy as np

from hopping_leg.arrays import Array


class RowResampling:
    """Where the rows of every window lie among the ticks.

    Values at the ticks have shape (ticks, hypotheses, windows, k), those at the rows
    (hypotheses, windows, rows, k). Windows with fewer rows than the longest repeat their last.

    Args:
        times: Of each window's rows since its first, s, (rows of that window,).
        tick: Time between two ticks, s.

    Attributes:
        ticks: How many ticks reach past the last row.
        padding: Which rows a window does not have, (windows, rows).
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
        """Return position and velocity at the rows by the cubic through both at the ticks.

        Args:
            q: Joint positions at the ticks, rad.
            qd: Joint velocities, rad/s, likewise.
        """
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
        between: Array = before + self._share * (after - before)
        return between

    def _ends(self, values: Array) -> tuple[Array, Array]:
        """Return what stands at the ticks around each row, (hypotheses, windows, rows, k)."""
        windows = np.arange(len(self._before))[:, None]
        moved = np.moveaxis(values, 0, 2)
        return moved[:, windows, self._before], moved[:, windows, self._before + 1]
