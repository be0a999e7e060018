"""Legs as a controller meets them: through sensors, noise, delay and soft limits."""

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.robot.limits import SoftLimiter, SoftLimits
from hopping_leg.sim.channel import Channel, Measurement, NoiseAndDelay
from hopping_leg.sim.simulator import Simulator


class Plant:
    """Legs behind a disturbed channel, with the soft joint limits in force unless None.

    The soft limits act on what the encoders report, free of noise and delay, as they run beside
    the motors, after the torque noise and before the motors' own limit. ``soft_limit_torque`` is
    what they added in the last tick, N m, (n, 2).
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
        self._limiter = SoftLimiter(legs.robot, soft_limits, legs.count) if soft_limits else None
        self.soft_limit_torque: Array = np.zeros((legs.count, 2))

    def reseed(self, rng: np.random.Generator) -> None:
        """Take all randomness from here on from another source."""
        self.channel.reseed(rng)
        self.legs.reseed(rng.spawn(1)[0])

    def sense(self, command: Array) -> Measurement:
        """Return what the controllers see; ``command`` is the desired height, m, (n,)."""
        return self.channel.sense(self.legs.measured_q, self.legs.measured_qd, command)

    def samples(self, command: Array) -> Array:
        """Return the same as ``sense`` as (q1, q2, qd1, qd2, command), newest first, (n, 3, 5)."""
        return self.channel.samples(self.legs.measured_q, self.legs.measured_qd, command)

    def drive(self, torque: Array) -> Array:
        """Apply joint torques for one control period; return what the motors gave, N m, (n, 2)."""
        disturbed = self.channel.actuate(torque)
        if self._limiter is not None:
            q, qd = self.legs.measured_q, self.legs.measured_qd
            limited = self._limiter.apply(disturbed, q, qd)
            self.soft_limit_torque, disturbed = limited - disturbed, limited
        return self.legs.step(disturbed)
