"""What was measured lately, newest first, with every late sample put where it belongs in time."""

import numpy as np

from hopping_leg.arrays import Array, IntArray, Stateful
from hopping_leg.sim.channel import Measurement


class SampleHistory(Stateful):
    """Joint samples of n legs by tick, newest first; a measurement's ages tell their places.

    ``length`` is the number of ticks to remember, ``period`` that of control, s.
    """

    STATE = ("known", "q", "qd")

    def __init__(self, length: int, period: float) -> None:
        self.length, self.period = length, period
        self.reset(0)

    def reset(self, count: int) -> None:
        """Forget everything; ``count`` legs follow."""
        self.known = np.zeros((self.length, count), np.bool_)
        """Whether a tick's sample has arrived, (length, n)."""
        self.q = np.zeros((self.length, count, 2))
        """Measured positions, rad, (length, n, 2); where unknown, what was there before."""
        self.qd = np.zeros((self.length, count, 2))
        """Measured velocities, rad/s, (length, n, 2); likewise."""

    def shift(self) -> None:
        """Begin a tick, of which nothing is known yet."""
        for history in (self.known, self.q, self.qd):
            history[1:] = history[:-1]
        self.known[0] = False

    def insert(self, measurement: Measurement) -> None:
        """Put this tick's three samples in their places."""
        back = np.rint(measurement.age / self.period).astype(np.int64)
        inside = back < self.length
        slot, (legs, _) = back[inside], np.nonzero(inside)
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
        unknown = ~self.known[: min(window, self.length - 1), :, None]
        for i in np.flatnonzero(unknown.any(axis=(1, 2)))[::-1]:
            for history in (self.q, self.qd):
                np.copyto(history[i], history[i + 1], where=unknown[i])


WINDOW = 11  # Ticks in which a late sample may still reach a ``DatedObserver``


class DatedObserver:
    """Fills a dated history with the samples as they arrive and filters it afresh each tick.

    Velocities carry little noise where they are small, positions carry much: positions are
    integrated from velocities and pulled towards the measured ones by a constant gain, 0 to 1,
    scalar or (n,), a sample. Between known velocities the unknown ones are interpolated; after the
    last one they are held. The control period is in s.
    """

    def __init__(self, period: float, gain: float | Array) -> None:
        self.period, self.gain = period, np.asarray(gain, dtype=np.float64)[..., None]
        self._track = SampleHistory(WINDOW, period)

    def reset(self, count: int) -> None:
        """Forget everything."""
        self._track.reset(count)
        self._anchor: Array | None = None
        self._past: list[Array] = []

    def update(self, measurement: Measurement) -> tuple[Array, Array]:
        """Update with a tick's measurement; return q and qd now, rad and rad/s, (n, 2)."""
        if self._anchor is None:
            self._anchor = measurement.q[:, 0].copy()
        else:
            self._anchor = self._past[-2]
            self._track.shift()
        self._track.insert(measurement)
        self._track.qd[:] = velocity = self._fill()
        self._past = self._integrate(velocity)
        return self._past[0], velocity[0]

    def _fill(self) -> Array:
        """Return velocities of the window with the gaps filled, (WINDOW, n, 2)."""
        known, filled, ticks = self._track.known, self._track.qd.copy(), np.arange(WINDOW)[:, None]
        newer = np.maximum.accumulate(np.where(known, ticks, -1))
        ahead = np.take_along_axis(filled, np.maximum(newer, 0)[..., None], axis=0)
        share = np.where(newer < 0, 0.0, 1 / (1 + ticks - newer))[..., None]
        for i in np.flatnonzero(~known[:-1].all(axis=1))[::-1]:
            between = filled[i + 1] + share[i] * (ahead[i] - filled[i + 1])
            np.copyto(filled[i], between, where=~known[i, :, None])
        return filled

    def _integrate(self, velocity: Array) -> list[Array]:
        """Return filtered positions of the window, newest first."""
        assert self._anchor is not None
        weight, measured = self.gain * self._track.known[..., None], self._track.q
        moved = (0.5 * self.period) * (velocity[1:] + velocity[:-1])
        position = self._anchor
        past = [position]
        for i in range(WINDOW - 2, -1, -1):
            position = position + moved[i]
            position = position + weight[i] * (measured[i] - position)
            past.append(position)
        past.reverse()
        return past
