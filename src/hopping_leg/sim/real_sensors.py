"""What encoders and current sensors report as ``[reality]`` has it: late, noisy, quantised.

The sensors sit at the motor, so that backlash and belt hide from them. Each reading is the true
value some physics steps ago, plus white noise, rounded to the sensor's step; it is drawn once per
control period.
"""

import numpy as np

from hopping_leg.arrays import Array, IntArray
from hopping_leg.robot.reality import Reality

DRAWS = 6
"""Normal random numbers per leg and reading: position, velocity, torque of both joints."""


class RealSensors:
    """Sensors of n legs; ``q``, ``qd`` and ``torque`` (n, 2) are the latest readings, live.

    Args:
        reality: The effects.
        count: Number of legs n.
        timestep: Physics step, s; the measurement's latency is rounded to it.
    """

    def __init__(self, reality: Reality, count: int, timestep: float) -> None:
        late = round(reality.latency.measurement / timestep)
        self._past = np.zeros((late + 1, count, DRAWS))
        self._newest = 0
        kinds = ("position", "velocity", "torque")
        self._noise = np.concatenate([reality.of_sensors(f"{kind}_noise") for kind in kinds])
        step = np.concatenate([reality.of_sensors(f"{kind}_step") for kind in kinds])
        self._rounded = np.flatnonzero(step)
        self._step = step[self._rounded]
        self._reading = np.zeros((count, DRAWS))
        self.q, self.qd, self.torque = (self._reading[:, k : k + 2] for k in (0, 2, 4))

    def watch(self, q: Array, qd: Array, torque: Array) -> None:
        """Take in the true state after a physics step.

        Args:
            q: Motor angle at the joint's side, rad, (n, 2).
            qd: Motor speed at the joint's side, rad/s, (n, 2).
            torque: Motor torque at the joint's side, N m, (n, 2).
        """
        self._newest = (self._newest + 1) % len(self._past)
        slot = self._past[self._newest]
        slot[:, 0:2], slot[:, 2:4], slot[:, 4:6] = q, qd, torque

    def read(self, draws: Array) -> None:
        """Renew the readings; ``draws`` are standard normal, (n, 6)."""
        oldest = self._past[(self._newest + 1) % len(self._past)]
        self._reading[:] = oldest + self._noise * draws
        self._round(slice(None))

    def forget(self, rows: IntArray, q: Array, qd: Array) -> None:
        """Read the present of some legs without noise, as if they had never moved otherwise."""
        present = np.concatenate([q[rows], qd[rows], np.zeros((len(rows), 2))], axis=1)
        self._past[:, rows] = present
        self._reading[rows] = present
        self._round(rows)

    def _round(self, rows: IntArray | slice) -> None:
        if len(self._rounded):
            reading = self._reading[rows]
            steps = np.round(reading[:, self._rounded] / self._step)
            reading[:, self._rounded] = steps * self._step
            self._reading[rows] = reading

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
