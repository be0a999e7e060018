"""Sensor noise, torque noise and delay, as the paper describes them ("Policy Robustness")."""

import itertools
from dataclasses import dataclass

import numpy as np

from hopping_leg.arrays import Array, IntArray, Stateful
from hopping_leg.errors import UsageError
from hopping_leg.sim.compiled import compiled

SAMPLES = 3
"""Joint samples a controller sees at a tick: t, t-1, t-2."""

DELAY_DEPTH = 10
"""Ticks after which the paper's channel delivers a sample no more."""

_DRAWS = 8
"""Random numbers per leg and tick: four for the joints, two for the delay, two for the torques."""

_BLOCK_SIZE = 16384  # Legs times ticks whose random numbers are drawn at once


@dataclass(frozen=True)
class NoiseAndDelay:
    """How a leg's sensors and motors deceive its controller; the defaults are the paper's.

    UsageError says that a value has no meaning.
    """

    joint_noise: float = 0.05
    """Lambda for joint positions and velocities: uniform within +-lambda times the value."""
    torque_noise: float = 0.15
    """Lambda for the output torques."""
    delay_probability: float = 0.5
    """Chance at each tick to see samples drawn from the buffer instead of the latest."""
    delay_buffer: int = DELAY_DEPTH
    """Ticks the buffer remembers."""

    def __post_init__(self) -> None:
        for name in ("joint_noise", "torque_noise", "delay_probability"):
            value = getattr(self, name)
            if not 0 <= value <= 1:
                raise UsageError(f"'{name}' is {value} but must lie between 0 and 1.")
        if self.delay_buffer < SAMPLES:
            raise UsageError(
                f"'delay_buffer' is {self.delay_buffer} but must hold at least {SAMPLES} ticks."
            )


NO_NOISE = NoiseAndDelay(joint_noise=0.0, torque_noise=0.0, delay_probability=0.0)
"""Perfect sensing and actuation."""


@dataclass(frozen=True)
class Measurement:
    """What a controller sees at one tick, newest sample first.

    Attributes:
        q: Joint positions, rad, (n, 3, 2).
        qd: Joint velocities, rad/s, (n, 3, 2).
        command: Desired apex height of the base, m, (n, 3).
        age: Time since each sample was taken, s, (n, 3).
    """

    q: Array
    qd: Array
    command: Array
    age: Array


class Channel(Stateful):
    """Between the legs and their controller: noise on both ways, delay on the way in.

    Every tick calls ``samples``, then ``actuate`` once. Noisy samples enter a buffer of the last
    ten ticks; with probability 0.5 three of them, in order of time, replace the latest three.
    ``period`` is the control period, s.
    """

    STATE = ("_buffer", "_draws", "_torque_noise", "_tick", "rng")

    def __init__(
        self,
        count: int,
        disturbance: NoiseAndDelay,
        period: float,
        rng: np.random.Generator,
    ) -> None:
        self.count, self.disturbance, self.period, self.rng = count, disturbance, period, rng
        depth = disturbance.delay_buffer
        self._orders = np.array(list(itertools.combinations(range(depth), SAMPLES)))
        self._buffer = np.zeros((depth, count, 5))
        self._back = np.zeros((count, SAMPLES))
        self._block = min(max(_BLOCK_SIZE // count, 16), 512)
        self._draws = np.empty((self._block, count, _DRAWS))
        self._tick = 0
        self._draw()

    def reseed(self, rng: np.random.Generator) -> None:
        """Take all randomness from here on from another source."""
        self.rng, self._tick = rng, 0
        self._draw()

    def restart(self, ids: IntArray | slice, q: Array, qd: Array, command: Array) -> None:
        """Forget the past of some legs: the buffer fills with their present, noiseless state.

        Shapes are (k, 2) for ``q``, rad, and ``qd``, rad/s, and (k,) for the heights ``command``,
        m.
        """
        self._buffer[:, ids, 0:2] = q
        self._buffer[:, ids, 2:4] = qd
        self._buffer[:, ids, 4] = command

    def samples(self, q: Array, qd: Array, command: Array) -> Array:
        """Return what is seen of the true state as (q1, q2, qd1, qd2, command), (n, 3, 5).

        Shapes are (n, 2) for ``q``, rad, and ``qd``, rad/s, and (n,) for the heights ``command``,
        m. Again in a tick, the noise is the same.
        """
        newest = self._buffer[self._tick % len(self._buffer)]
        newest[:, 0:2], newest[:, 2:4], newest[:, 4] = q, qd, command
        samples, disturbance = np.empty((self.count, SAMPLES, 5)), self.disturbance
        _disturb(
            self._draws, self._buffer, self._orders, self._tick, disturbance.joint_noise,
            disturbance.delay_probability, samples, self._back,
        )  # fmt: skip
        return samples

    def measurement(self, samples: Array) -> Measurement:
        """Name the parts of this tick's ``samples``."""
        age = self._back * self.period
        return Measurement(samples[..., 0:2], samples[..., 2:4], samples[..., 4], age)

    def actuate(self, torque: Array) -> Array:
        """Return the torques that reach the motors, N m, (n, 2); ends the tick."""
        disturbed: Array = torque * self._torque_noise[self._tick % self._block]
        self._tick += 1
        if self._tick % self._block == 0:
            self._draw()
        return disturbed

    def _draw(self) -> None:
        self.rng.random(out=self._draws)
        noise = self.disturbance.torque_noise
        self._torque_noise = 1 + noise * (2 * self._draws[..., 6:8] - 1)


@compiled
def _disturb(
    draws: Array,
    buffer: Array,
    orders: IntArray,
    tick: int,
    joint_noise: float,
    delay_probability: float,
    samples: Array,
    back: Array,
) -> None:
    """Set a tick's ``samples`` and by how many ticks they lie ``back``, of true values.

    The newest slot of the buffer holds the true values, which noise disturbs.
    """
    depth = len(buffer)
    for leg, draw in enumerate(draws[tick % len(draws)]):
        newest = buffer[tick % depth, leg]
        for i in range(4):
            newest[i] *= 1 + joint_noise * (2 * draw[i] - 1)
        order = orders[int(draw[5] * len(orders))]
        late = draw[4] < delay_probability
        for k in range(SAMPLES):
            ticks = order[k] if late else k
            back[leg, k] = ticks
            seen = buffer[(tick - ticks) % depth, leg]
            for i in range(len(seen)):  # to assign all at once takes seconds to compile
                samples[leg, k, i] = seen[i]
