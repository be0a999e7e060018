"""Legs as a controller meets them: through sensors, noise, delay and soft limits."""

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.robot import Robot, SoftLimits
from hopping_leg.sim.channel import Channel, Measurement, NoiseAndDelay
from hopping_leg.sim.compiled import compiled
from hopping_leg.sim.leg_simulator import LegSimulator


class SoftLimiter:
    """Adds the soft limits' PD to a controller's torque, in simulation, emulator and deployment."""

    def __init__(self, robot: Robot, soft: SoftLimits) -> None:
        self._bounds = np.stack([robot.of_joints("lower"), robot.of_joints("upper")], axis=1)
        self._gains = np.array([soft.stiffness, soft.damping, soft.inset, float(soft.replace)])
        self.added(np.zeros((1, 2)), np.zeros((1, 1, 4)))  # compiled before any control loop

    def added(self, torque: Array, samples: Array) -> Array:
        """Return what to add to a controller's torque, N m, (n, 2).

        Samples are (q1, q2, qd1, qd2, ...), rad and rad/s, newest first, (n, k, 4 or more); the
        newest counts. Nothing is added where a joint is within bounds. The sum is then limited as
        any torque is.
        """
        added = np.zeros((len(samples), 2))
        asked = np.ascontiguousarray(torque, np.float64)
        _add(added, asked, np.ascontiguousarray(samples, np.float64), self._bounds, self._gains)
        return added


@compiled
def _add(added: Array, torque: Array, samples: Array, bounds: Array, gains: Array) -> None:
    stiffness, damping, inset, replace = gains
    for leg in range(len(samples)):
        for joint in range(2):
            angle, speed = samples[leg, 0, joint], samples[leg, 0, 2 + joint]
            back = min(max(angle, bounds[joint, 0]), bounds[joint, 1]) - angle
            if back != 0.0:
                back += inset if back > 0.0 else -inset
                pull = stiffness * back - damping * speed
                added[leg, joint] = pull - replace * torque[leg, joint]


class Plant:
    """Legs behind a disturbed channel, with the soft joint limits in force unless None.

    The soft limits act on the newest sample that the controllers saw, noisy and late as it is, as
    on the robot; what they add goes through the torque noise and the limits with the rest. Every
    tick calls ``sense`` or ``samples``, then ``drive``.

    ``soft_limit_torque`` is what they added in the last tick, before noise and limits, N m, (n, 2).
    """

    def __init__(
        self,
        legs: LegSimulator,
        disturbance: NoiseAndDelay,
        soft_limits: SoftLimits | None,
        rng: np.random.Generator,
    ) -> None:
        self.legs = legs
        self.channel = Channel(legs.count, disturbance, legs.period, rng)
        legs.rng = rng.spawn(1)[0]
        self._limiter = SoftLimiter(legs.robot, soft_limits) if soft_limits else None
        self._samples: Array = np.empty((0, 3, 5))
        self.soft_limit_torque: Array = np.zeros((legs.count, 2))

    def reseed(self, rng: np.random.Generator) -> None:
        """Take all randomness from here on from another source."""
        self.channel.reseed(rng)
        self.legs.rng = rng.spawn(1)[0]

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
