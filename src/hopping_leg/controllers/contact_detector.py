"""Touchdown without a sensor: the ground pushes the leg together, or the flight PD resists it."""

import numpy as np

from hopping_leg.arrays import Array, BoolArray
from hopping_leg.controllers.shaping_gains import Gain

_MEMORY = 3


class TouchdownDetector:
    """Watches how the leg deviates from the planned retraction.

    Args:
        count: Number of legs n.
        debounced: Judge the median of the last three ticks, so that one noisy sample cannot fake
            a touchdown.
    """

    def __init__(self, count: int, *, debounced: bool) -> None:
        depth = _MEMORY if debounced else 1
        self._excess = np.zeros((depth, count))
        self._resisting = np.zeros((depth, count))

    def update(
        self, excess: Array, force: Array, least_excess: Gain, least_force: Gain
    ) -> BoolArray:
        """Return which legs meet the ground, (n,).

        A soft leg gives way, a stiff one resists: either tells.

        Args:
            excess: Leg rate less the planned one, m/s, (n,).
            force: With which the flight PD extends the leg, N, (n,).
            least_excess: Threshold, negative, m/s.
            least_force: Threshold, N.
        """
        for history, newest in ((self._excess, excess), (self._resisting, force)):
            history[1:] = history[:-1].copy()
            history[0] = newest
        yields: BoolArray = np.median(self._excess, axis=0) < least_excess
        resists: BoolArray = np.median(self._resisting, axis=0) > least_force
        return yields | resists
