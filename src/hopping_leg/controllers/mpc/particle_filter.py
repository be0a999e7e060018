"""A particle filter on the stepper: where a leg is, from its joints and its own commands alone.

A particle is a whole leg: its state and what may differ from its file. In every control period

1. each takes a step with the commands in force, its motors off by a random share;
2. joints are corrected by the Kalman gain of a fresh sample; the foot of a particle that stands
   stays where it is and one in the air keeps its momentum, so that joints correct the base as well;
3. a particle counts by how likely the sample was, with Student's tails, and late samples by what
   its joints were then;
4. where few count for much, they are resampled, parameters with the kernel of Liu and West (2001).

Innovations larger than expected scale the assumed noise. Where the likelihood stays below its mean
(CUSUM), track is lost: half of the particles begin anew in height, speed and parameters.
"""

from dataclasses import astuple, dataclass, fields, replace

import numpy as np

from hopping_leg.arrays import Array, BoolArray, IntArray, Records
from hopping_leg.controllers.mpc import particles
from hopping_leg.controllers.mpc.particles import DEPTH, DRAWS, FAR, PARTICLE, SLOWLY
from hopping_leg.controllers.protocol import Measurement
from hopping_leg.robot import NO_MISMATCH, Robot, kinematics
from hopping_leg.sim import stepper
from hopping_leg.sim.compiled import compiling_notice
from hopping_leg.sim.leg_table import leg_table

PARAMETERS = ("payload", "rail_friction", "ground_time", "knee_gain")
"""Logarithm of the mass over the file's, rail friction beyond it, N, logarithms of the ground's
time constant and of the knee's torque over the file's."""

_NOISY = 0.008  # share of measured values from which on they are noisy


@dataclass(frozen=True)
class FilterOptions:
    """What a particle filter assumes; noise is standard deviations per control period."""

    particles: int = 500
    """How many."""
    steps: int = 5
    """Physics steps per control period."""
    torque_noise: float = 0.087
    """Of a motor's torque, as a share of it: the paper's."""
    rail_noise: float = 0.003
    """Of the base's speed, m/s."""
    speed_noise: float = 0.15
    """Of a joint's speed, rad/s."""
    angle_noise: float = 1e-4
    """Of a joint's angle, rad."""
    measured_speed: float = 0.1
    """Of a measured speed, rad/s, beyond the share that its samples show to be noise."""
    measured_angle: float = 2e-4
    """Of a measured angle, rad, likewise."""
    payload: float = 0.2
    """Spread of a parameter where track is lost, see ``PARAMETERS``."""
    rail_friction: float = 1.0
    """The same."""
    ground_time: float = 0.8
    """The same."""
    knee_gain: float = 0.1
    """The same."""
    kernel: float = 0.98
    """Share of a parameter's distance from the mean that resampling leaves."""
    first_spread: float = 0.1
    """Spread at first, when the file is believed, over that where track is lost."""
    least_spread: float = 0.1
    """Least spread that resampling restores, over the same."""
    adapt: float = 0.03
    """Weight of an innovation in the scale of noise."""
    most_noise: float = 25.0
    """Largest scale, of variances."""
    tail: float = 4.0
    """Degrees of freedom of Student's distribution of innovations."""
    margin: float = 3.0
    """By how much a logarithm of the likelihood may be below its mean."""
    lost: float = 15.0
    """Sum of what is beyond that with which track is lost."""


OPTIONS = np.dtype([(field.name, np.float64) for field in fields(FilterOptions)])


class ParticleFilter:
    """Estimates states and parameters of legs that measure their joints alone.

    A leg's estimate does not depend on the number of legs.

    Args:
        robot: What is believed of the legs; its ``reality`` is unknown.
        period: Control period, s.
        options: What is assumed.
        seed: Of all randomness.
    """

    def __init__(
        self, robot: Robot, period: float, options: FilterOptions | None = None, seed: int = 0
    ) -> None:
        self.options, self.period, self._seed = options or FilterOptions(), period, seed
        self._robot = replace(robot, reality=NO_MISMATCH)
        self._believed = leg_table([self._robot], period / self.options.steps)
        self._how = np.array([astuple(self.options)], OPTIONS)
        with compiling_notice(particles.predict, particles.update):
            self.reset(1)
            joints, others = np.zeros((1, 3, 2)), np.zeros((1, 3))
            still = Measurement(joints, joints, others, others)
            self.update(still)
            self.send(np.zeros((1, 2)))
            self.update(still)
        self.reset(0)

    def reset(self, count: int) -> None:
        """Forget everything; ``count`` legs follow."""
        self._rng = np.random.default_rng(self._seed)
        self._particles = np.zeros((count, self.options.particles), PARTICLE)
        self._spare = np.zeros(self.options.particles, PARTICLE)
        self._scratch = np.zeros(1, stepper.MEMORY)
        self._mean, self._health = np.zeros((count, 11)), np.zeros((count, 3))
        self._scale, self._begun = np.ones((count, 2)), np.zeros(count, np.bool_)
        self._known = np.ones((count, DEPTH), np.bool_)
        self._gap, self._size = np.full(count, 0.03**2), np.ones(count)
        self._command = np.zeros(stepper.COMMAND)
        self._tick = 0
        self.rows: Records = np.repeat(self._believed, count)
        """The legs as they are believed now."""
        self.memory: Records = np.zeros(count, stepper.MEMORY)
        """Commands in force and under way."""

    @property
    def state(self) -> Array:
        """Mean states, (n, 6)."""
        return np.ascontiguousarray(self._mean[:, :6])

    @property
    def parameters(self) -> Array:
        """Mean ``PARAMETERS``, (n, 4)."""
        return self._mean[:, 6:10]

    @property
    def apex(self) -> Array:
        """Height of the last apex as it is known by now, m, (n,)."""
        return self._mean[:, 10].copy()

    @property
    def losses(self) -> Array:
        """How often track was lost, (n,)."""
        return self._health[:, 2]

    def update(self, measurement: Measurement) -> None:
        """Go on by a control period and take what was measured at its end."""
        draws = self._rng.standard_normal((self.options.particles, DRAWS))
        start, slot, how = self._rng.random(), self._tick % DEPTH, self._how[0]
        samples = np.concatenate([measurement.q, measurement.qd], axis=2)
        fine = np.abs(samples).max(axis=2) < FAR
        samples = np.where(fine[:, :, None], samples, 0.0)
        share = self._noise(samples, fine, measurement.age)
        slots = self._new(measurement.age, fine)
        believed = self._believed[0]
        for k in range(len(samples)):
            if self._begun[k]:
                particles.predict(
                    believed, self.rows[k], self._particles[k], self.memory[k], self._scratch[0],
                    draws, self._scale[k], how, self.period,
                )  # fmt: skip
            else:
                self._begin(k, samples[k, 0], draws)
            self._begun[k] = particles.update(
                believed, self._particles[k], self._spare, samples[k], slots[k], slot, share[k],
                self._scale[k], draws, start, how, self.period, self._mean[k], self._health[k],
            )  # fmt: skip
            particles.set_mean_row(believed, self._mean[k], self.rows[k])
        self._tick += 1

    def send(self, torque: Array) -> None:
        """Take note of what is commanded now, N m, (n, 2)."""
        for k, asked in enumerate(torque):
            self._command[:2] = asked
            particles.send(
                self.memory[k], self._command, float(self._believed["command_latency"][0])
            )

    def _begin(self, leg: int, sample: Array, draws: Array) -> None:
        """Let a leg stand at rest."""
        how, own = self.options, self._particles[leg]
        own[:] = np.zeros((), PARTICLE)
        self._known[leg] = True
        state = own["state"]
        state[:, 1:3] = sample[:2] * (1 + 0.03 * draws[:, :2])
        state[:, 4:6] = sample[2:] + 0.1 * draws[:, 2:4]
        state[:, 0] = kinematics.stance_height(self._robot, state[:, 1:3])
        state[:, 0] += 0.002 * draws[:, 4] - 0.001
        state[:, 3] = 0.02 * draws[:, 5]
        spread = np.array([getattr(how, name) for name in PARAMETERS])
        own["parameters"] = how.first_spread * spread * draws[:, 6:10]

    def _new(self, age: Array, fine: BoolArray) -> IntArray:
        """Return the places of samples in the past, -1 of those that are known, (n, 3)."""
        back = np.rint(age / self.period).astype(np.int64)
        slots, legs = (self._tick - back) % DEPTH, np.arange(len(age))[:, None]
        self._known[:, self._tick % DEPTH] = False
        new = fine & (back < DEPTH) & ~self._known[legs, slots]
        self._known[legs, slots] |= new
        return np.where(new, slots, -1)

    def _noise(self, samples: Array, fine: BoolArray, age: Array) -> Array:
        """Return the share of noise in measured values, (n,): how ill angles and speeds fit."""
        q, qd = samples[:, :2, :2], samples[:, :2, 2:]
        fits = np.rint((age[:, 1] - age[:, 0]) / self.period) == 1
        weight = np.where(fits & fine[:, :2].all(axis=1), SLOWLY, 0.0)
        gap = (q[:, 0] - q[:, 1] - self.period / 2 * qd.sum(axis=1)) ** 2
        size = (q**2).sum(axis=1)
        self._gap += weight * (np.minimum(gap, 0.005 * size).mean(axis=1) - self._gap)
        self._size += weight * (size.mean(axis=1) - self._size)
        share = np.sqrt(self._gap / np.maximum(self._size, 1e-9))
        return np.where(share < _NOISY, 0.0, share)
