"""Sensor noise, torque noise and delay, as the paper describes them ("Policy Robustness")."""

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np

from hopping_leg.arrays import Array, IntArray

SAMPLES = 3
"""Joint samples a controller sees at a tick: t, t-1, t-2."""

_BLOCK = 64
"""Ticks of random numbers drawn at once."""


@dataclass(frozen=True)
class Disturbance:
    """How a leg's sensors and motors deceive its controller; the defaults are the paper's."""

    joint_noise: float = 0.05
    """Lambda for joint positions and velocities: uniform within +-lambda times the value."""
    torque_noise: float = 0.15
    """Lambda for the output torques."""
    delay_probability: float = 0.5
    """Chance at each tick to see samples drawn from the buffer instead of the latest."""
    delay_buffer: int = 10
    """Ticks the buffer remembers."""


NOTHING = Disturbance(joint_noise=0.0, torque_noise=0.0, delay_probability=0.0)
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


class Channel:
    """Between the legs and their controller: noise on both ways, delay on the way in.

    Every tick calls ``sense`` once, then ``actuate`` once. Noisy samples enter a buffer of the
    last ten ticks; with probability 0.5 three of them, in order of time, replace the latest three.

    Args:
        count: Number of legs n.
        disturbance: How strong.
        period: Control period, s.
        rng: Source of all randomness.
    """

    def __init__(
        self, count: int, disturbance: Disturbance, period: float, rng: np.random.Generator
    ) -> None:
        self.count, self.disturbance, self.period, self.rng = count, disturbance, period, rng
        depth = disturbance.delay_buffer
        self._orders = np.array(list(itertools.combinations(range(depth), SAMPLES)))
        self._latest = np.arange(SAMPLES)
        self._buffer = np.zeros((depth, count, 5))
        self._legs = np.arange(count)[:, None]
        self._tick = 0
        self._draws = np.empty((_BLOCK, count, 8))

    def restart(self, ids: IntArray | slice, q: Array, qd: Array, command: Array) -> None:
        """Forget the past of some legs: the buffer fills with their present, noiseless state.

        Args:
            ids: Which legs.
            q: Joint positions, rad, (k, 2).
            qd: Joint velocities, rad/s, (k, 2).
            command: Desired heights, m, (k,).
        """
        self._buffer[:, ids, 0:2] = q
        self._buffer[:, ids, 2:4] = qd
        self._buffer[:, ids, 4] = command

    def sense(self, q: Array, qd: Array, command: Array) -> Measurement:
        """Return what the controllers see of the true state.

        Args:
            q: Joint positions, rad, (n, 2).
            qd: Joint velocities, rad/s, (n, 2).
            command: Desired heights, m, (n,).
        """
        index = self._tick % _BLOCK
        if index == 0:
            self.rng.random(out=self._draws)
        draw = self._draws[index]
        depth = len(self._buffer)
        sample = self._buffer[self._tick % depth]
        sample[:, 0:2] = q
        sample[:, 2:4] = qd
        sample[:, :4] *= 1 + self.disturbance.joint_noise * (2 * draw[:, :4] - 1)
        sample[:, 4] = command
        delayed = draw[:, 4] < self.disturbance.delay_probability
        order = self._orders[(draw[:, 5] * len(self._orders)).astype(np.int64)]
        back = np.where(delayed[:, None], order, self._latest)
        seen = self._buffer[(self._tick - back) % depth, self._legs]
        return Measurement(seen[..., 0:2], seen[..., 2:4], seen[..., 4], back * self.period)

    def actuate(self, torque: Array) -> Array:
        """Return the torques that reach the motors, N m, (n, 2); ends the tick."""
        draw = self._draws[self._tick % _BLOCK]
        self._tick += 1
        return torque * (1 + self.disturbance.torque_noise * (2 * draw[:, 6:8] - 1))

    def state(self) -> dict[str, Any]:
        """Return everything needed to go on exactly from here, as arrays and plain values."""
        return {
            "buffer": self._buffer.copy(),
            "draws": self._draws.copy(),
            "tick": self._tick,
            "rng": self.rng.bit_generator.state,
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Go on from a ``state``."""
        self._buffer[:] = state["buffer"]
        self._draws[:] = state["draws"]
        self._tick = int(state["tick"])
        self.rng.bit_generator.state = state["rng"]
