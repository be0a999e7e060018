"""Touchdown from the leg's own motion: the ground pushes the leg together."""

import numpy as np

from hopping_leg.arrays import Array, BoolArray
from hopping_leg.control.shaping_gains import Gain

_MEMORY = 3


class TouchdownDetector:
    """Watches the leg rate beyond that of the planned retraction.

    Args:
        count: Number of legs n.
        debounced: Judge the median of the last three ticks, so that one noisy sample cannot fake
            a touchdown.
    """

    def __init__(self, count: int, *, debounced: bool) -> None:
        self._excess = np.zeros((_MEMORY if debounced else 1, count))

    def update(self, rate: Array, planned_rate: Array, threshold: Gain) -> BoolArray:
        """Return which legs are being pushed together, (n,).

        Args:
            rate: Of the leg length, m/s, (n,).
            planned_rate: What the retraction asks for, m/s, (n,).
            threshold: Negative, m/s.
        """
        self._excess[1:] = self._excess[:-1].copy()
        self._excess[0] = rate - planned_rate
        pushed: BoolArray = np.median(self._excess, axis=0) < threshold
        return pushed
