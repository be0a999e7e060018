"""Legs as a controller meets them: through sensors, noise, delay and soft limits."""

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.robot import SoftLimits
from hopping_leg.sim.channel import Channel, Measurement, NoiseAndDelay
from hopping_leg.sim.simulator import Simulator
from hopping_leg.sim.soft_limiter import SoftLimiter


class Plant:
    """Legs behind a disturbed channel, with the soft joint limits in force unless None.

    The soft limits act on the newest sample that the controllers saw, noisy and late as it is, as
    on the robot; what they add goes through the torque noise and the limits with the rest. Every
    tick calls ``sense`` or ``samples``, then ``drive``.

    ``soft_limit_torque`` is what they added in the last tick, before noise and limits, N m, (n, 2).
    """

    def __init__(
        self,
        legs: Simulator,
        disturbance: NoiseAndDelay,
        soft_limits: SoftLimits | None,
        rng: np.random.Generator,
    ) -> None:
        self.legs = legs
        self.channel = Channel(legs.count, disturbance, legs.period, rng)
        legs.reseed(rng.spawn(1)[0])
        self._limiter = SoftLimiter(legs.robot, soft_limits) if soft_limits else None
        self._samples: Array = np.empty((0, 3, 5))
        self.soft_limit_torque: Array = np.zeros((legs.count, 2))

    def reseed(self, rng: np.random.Generator) -> None:
        """Take all randomness from here on from another source."""
        self.channel.reseed(rng)
        self.legs.reseed(rng.spawn(1)[0])

    def sense(self, command: Array) -> Measurement:
        """Return what the controllers see; ``command`` is the desired height, m, (n,)."""
        return self.channel.measurement(self.samples(command))

    def samples(self, command: Array) -> Array:
        """Return the same as ``sense`` as (q1, q2, qd1, qd2, command), newest first, (n, 3, 5)."""
        legs = self.legs
        self._samples = self.channel.samples(legs.measured_q, legs.measured_qd, command)
        return self._samples

    def drive(self, torque: Array) -> Array:
        """Apply joint torques for one control period; return what the motors gave, N m, (n, 2)."""
        if self._limiter is not None:
            self.soft_limit_torque = self._limiter.added(torque, self._samples)
            torque = torque + self.soft_limit_torque
        return self.legs.step(self.channel.actuate(torque))
