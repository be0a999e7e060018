"""The channel between controllers and legs that are more than the simulator for training knows."""

from typing import Any

import numpy as np

from hopping_leg.arrays import Array, IntArray
from hopping_leg.sim.disturbance import Channel, Disturbance
from hopping_leg.sim.reality import RealLegs


class RealChannel(Channel):
    """Carries the legs' own memory and randomness along, so that runs repeat and go on exactly.

    The disturbance acts on top of what the legs' sensors report; judge a twin with ``NOTHING`` to
    meet it as it is.

    Args:
        real: The legs behind the channel.
        disturbance: How strong.
        period: Control period, s.
        rng: Source of all randomness.
    """

    def __init__(
        self, real: RealLegs, disturbance: Disturbance, period: float, rng: np.random.Generator
    ) -> None:
        super().__init__(real.count, disturbance, period, rng)
        self._real = real
        real.reseed(rng.spawn(1)[0])

    def reseed(self, rng: np.random.Generator) -> None:
        """Take all randomness from here on from another source."""
        super().reseed(rng)
        self._real.reseed(rng.spawn(1)[0])

    def restart(self, ids: IntArray | slice, q: Array, qd: Array, command: Array) -> None:
        """Forget the past of some legs, on the way to the motors, too."""
        self._real.forget(np.arange(self.count)[ids])
        super().restart(ids, q, qd, command)

    def state(self) -> dict[str, Any]:
        """Return everything needed to go on exactly from here, as arrays and plain values."""
        return super().state() | self._real.memory()

    def restore(self, state: dict[str, Any]) -> None:
        """Go on from a ``state``; the legs' physics must have been restored."""
        super().restore(state)
        self._real.restore(state)
