"""What encoders and current sensors report as ``[reality]`` has it: late, noisy, quantised.

The sensors sit at the motor, so that backlash and belt hide from them. Each reading is the true
value some physics steps ago, plus white noise, rounded to the sensor's step; it is drawn once per
control period.
"""

from collections.abc import Sequence

import numpy as np

from hopping_leg.arrays import Array, IntArray
from hopping_leg.robot.model_mismatch import ModelMismatch

DRAWS = 6
"""Normal random numbers per leg and reading: position, velocity, torque of both joints."""


class EncoderEffects:
    """Sensors of n legs; ``q``, ``qd`` and ``torque`` (n, 2) are the latest readings, live.

    ``realities`` has one for each leg; the measurement's latency is rounded to ``timestep``, s.
    """

    def __init__(self, realities: Sequence[ModelMismatch], timestep: float) -> None:
        count = len(realities)
        self._timestep, self._legs = timestep, np.arange(count)
        self._past = np.zeros((1, count, DRAWS))
        self._newest = 0
        self.set_robots(realities)
        self._reading = np.zeros((count, DRAWS))
        self.q, self.qd, self.torque = (self._reading[:, k : k + 2] for k in (0, 2, 4))

    def set_robots(self, realities: Sequence[ModelMismatch]) -> None:
        """Go on as the sensors of other realities; a longer past begins with the oldest known."""
        latency = np.array([reality.latency.measurement for reality in realities])
        self._late = np.round(latency / self._timestep).astype(np.int64)
        rising = np.roll(self._past, -self._newest - 1, axis=0)
        more = max(0, int(self._late.max()) + 1 - len(rising))
        self._past = np.concatenate([np.repeat(rising[:1], more, axis=0), rising])
        self._newest = len(self._past) - 1
        self._noise, step = (_of_sensors(realities, what) for what in ("noise", "step"))
        self._rounded = np.flatnonzero(step.any(axis=0))
        self._step = step[:, self._rounded]

    def watch(self, q: Array, qd: Array, torque: Array) -> None:
        """Record the true state of the motors, at the joints' side, after a physics step.

        Angles are in rad, speeds in rad/s and torques in N m, (n, 2).
        """
        self._newest = (self._newest + 1) % len(self._past)
        slot = self._past[self._newest]
        slot[:, 0:2], slot[:, 2:4], slot[:, 4:6] = q, qd, torque

    def read(self, draws: Array) -> None:
        """Renew the readings; ``draws`` are standard normal, (n, 6)."""
        seen = self._past[(self._newest - self._late) % len(self._past), self._legs]
        self._reading[:] = seen + self._noise * draws
        self._round(self._legs)

    def forget(self, rows: IntArray, q: Array, qd: Array) -> None:
        """Read the present of some legs without noise, as if they had never moved otherwise."""
        present = np.concatenate([q[rows], qd[rows], np.zeros((len(rows), 2))], axis=1)
        self._past[:, rows] = present
        self._reading[rows] = present
        self._round(rows)

    def _round(self, rows: IntArray) -> None:
        if len(self._rounded):
            place = np.ix_(rows, self._rounded)
            exact, step = self._reading[place], self._step[rows]
            steps = np.round(np.divide(exact, step, out=np.zeros_like(exact), where=step > 0))
            self._reading[place] = np.where(step > 0, steps * step, exact)

    def memory(self) -> dict[str, Array]:
        """Return everything needed to go on exactly from here."""
        return {
            "past": self._past.copy(),
            "newest": np.array(self._newest),
            "reading": self._reading.copy(),
        }

    def restore(self, memory: dict[str, Array]) -> None:
        """Go on from a ``memory``."""
        self._past[:], self._newest = memory["past"], int(memory["newest"])
        self._reading[:] = memory["reading"]


def _of_sensors(realities: Sequence[ModelMismatch], what: str) -> Array:
    """Return noise or step of position, velocity and torque of both joints, (n, 6)."""
    kinds = ("position", "velocity", "torque")
    return np.array(
        [np.concatenate([r.of_sensors(f"{k}_{what}") for k in kinds]) for r in realities]
    )
