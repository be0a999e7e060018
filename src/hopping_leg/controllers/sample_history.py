"""The joints' recent past with every late sample put where it belongs in time."""

from typing import Any

import numpy as np

from hopping_leg.arrays import Array, BoolArray, IntArray
from hopping_leg.controllers.recent import RingBuffer
from hopping_leg.sim.channel import Measurement


class SampleHistory:
    """Joint samples of n legs by tick, newest first; a measurement's ages tell their places.

    Args:
        length: Ticks to remember; older samples are ignored.
        period: Control period, s.
    """

    def __init__(self, length: int, period: float) -> None:
        self.length, self.period = length, period
        self.reset(0)

    def reset(self, count: int) -> None:
        """Forget everything; ``count`` legs follow."""
        self._legs = np.arange(count)[:, None]
        self._known = RingBuffer(np.zeros((self.length, count), np.bool_))
        self._q = RingBuffer(np.zeros((self.length, count, 2)))
        self._qd = RingBuffer(np.zeros((self.length, count, 2)))

    @property
    def known(self) -> BoolArray:
        """Whether a tick's sample has arrived, (length, n)."""
        return self._known.frames

    @property
    def q(self) -> Array:
        """Measured positions, rad, (length, n, 2); where unknown, what was there before."""
        return self._q.frames

    @property
    def qd(self) -> Array:
        """Measured velocities, rad/s, (length, n, 2); likewise."""
        return self._qd.frames

    def shift(self) -> None:
        """Begin a tick, of which nothing is known yet."""
        for history in (self._known, self._q, self._qd):
            history.shift()
        self.known[0] = False
        self.q[0], self.qd[0] = self.q[1], self.qd[1]

    def insert(self, measurement: Measurement) -> None:
        """Put this tick's three samples in their places."""
        back = np.rint(measurement.age / self.period).astype(np.int64)
        inside = back < self.length
        slot, legs = back[inside], np.broadcast_to(self._legs, back.shape)[inside]
        self.known[slot, legs] = True
        self.q[slot, legs] = measurement.q[inside]
        self.qd[slot, legs] = measurement.qd[inside]

    def fill(self, rows: IntArray | slice, measurement: Measurement) -> None:
        """Take the newest sample of some legs for their whole past."""
        self.known[:, rows] = True
        self.q[:, rows] = measurement.q[rows, 0]
        self.qd[:, rows] = measurement.qd[rows, 0]

    def hold(self, window: int) -> None:
        """Give unknown ticks among the newest ``window`` the last sample known before them."""
        known_at, histories = self.known, (self.q, self.qd)
        for i in range(min(window, self.length - 1) - 1, -1, -1):
            known = known_at[i, :, None]
            for history in histories:
                np.copyto(history[i], history[i + 1], where=~known)

    def state(self) -> dict[str, Any]:
        """Return everything remembered, as arrays."""
        return {"known": self.known.copy(), "q": self.q.copy(), "qd": self.qd.copy()}

    def restore(self, state: dict[str, Any]) -> None:
        """Go on from a ``state``."""
        self.reset(state["known"].shape[1])
        self.known[:], self.q[:], self.qd[:] = state["known"], state["q"], state["qd"]
