"""Joint state from noisy, late samples: every sample is put where it belongs in time."""

from dataclasses import dataclass

import numpy as np

from hopping_leg.arrays import Array, BoolArray
from hopping_leg.controllers.sample_history import SampleHistory
from hopping_leg.sim.channel import Measurement

WINDOW = 11
"""Ticks in which a late sample may still arrive."""


@dataclass(frozen=True)
class JointState:
    """Estimated joint state of n legs now.

    Attributes:
        q: Joint positions, rad, (n, 2).
        qd: Joint velocities, rad/s, (n, 2).
    """

    q: Array
    qd: Array


class DatedObserver:
    """Fills a dated history with the samples as they arrive and filters it afresh each tick.

    Velocities carry little noise where they are small, positions carry much: positions are
    integrated from velocities and pulled towards the measured ones by a constant gain. Between
    known velocities the unknown ones are interpolated; after the last one they are held.

    Args:
        period: Control period, s.
        gain: Pull per sample towards the measured position, 0 to 1, scalar or (n,).
    """

    def __init__(self, period: float, gain: float | Array) -> None:
        self.period, self.gain = period, np.asarray(gain, dtype=np.float64)[..., None]
        self._track = SampleHistory(WINDOW, period)

    def reset(self, count: int) -> None:
        """Forget everything."""
        self._track.reset(count)
        self._anchor: Array | None = None
        self._past: list[Array] = []

    def update(self, measurement: Measurement) -> JointState:
        """Update with the measurement of this tick; return the state now."""
        if self._anchor is None:
            self._anchor = measurement.q[:, 0].copy()
        else:
            self._anchor = self._past[-2]
            self._track.shift()
        self._track.insert(measurement)
        self._track.qd[:] = velocity = self._fill()
        self._past = self._integrate(velocity)
        return JointState(self._past[0], velocity[0])

    def _fill(self) -> Array:
        """Return velocities of the window with the gaps filled, (WINDOW, n, 2)."""
        known: BoolArray = self._track.known
        filled = self._track.qd.copy()
        newer, gap = filled[0], np.full(known.shape[1], np.inf)
        ahead_value, ahead_gap = np.empty_like(filled), np.empty(known.shape)
        for i in range(WINDOW):
            newer = np.where(known[i, :, None], filled[i], newer)
            gap = np.where(known[i], 0.0, gap + 1)
            ahead_value[i], ahead_gap[i] = newer, gap
        for i in range(WINDOW - 2, -1, -1):
            share = 1 / (1 + ahead_gap[i])[:, None]
            between = filled[i + 1] + share * (ahead_value[i] - filled[i + 1])
            filled[i] = np.where(known[i, :, None], filled[i], between)
        return filled

    def _integrate(self, velocity: Array) -> list[Array]:
        """Return filtered positions of the window, newest first."""
        assert self._anchor is not None
        weight = self.gain * self._track.known[..., None]
        position = self._anchor
        past = [position]
        for i in range(WINDOW - 2, -1, -1):
            position = position + (0.5 * self.period) * (velocity[i + 1] + velocity[i])
            position = position + weight[i] * (self._track.q[i] - position)
            past.append(position)
        past.reverse()
        return past


class LatestObserver:
    """Takes the newest sample as the state, however old."""

    def reset(self, count: int) -> None:
        """Nothing to forget."""

    def update(self, measurement: Measurement) -> JointState:
        """Return the newest sample."""
        return JointState(measurement.q[:, 0], measurement.qd[:, 0])
