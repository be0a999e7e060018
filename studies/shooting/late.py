"""Shooting that sees as little as a policy does: late, and with errors about velocities."""

from collections import deque
from typing import Any

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.controllers.shooting import HopShape, Shooting
from hopping_leg.robot import Robot
from hopping_leg.sim import stepper

DELAY = 2
"""Control periods by which the state is late; the commands since are known."""

_SPEED_ERROR = (0.015, 0.019)
"""Error of the base's velocity: so much, m/s, and so much of its value. With these numbers hops
scatter about as those of the distilled policies do."""

_JOINT_SPEED_ERROR = 0.1  # rad/s
_LASTING = 0.7  # share of an error that is left a control period later


class LateShooting(Shooting):
    """Plans from the state two control periods ago, carried forward, with errors of velocities."""

    name = "late-shooting"

    def __init__(self, robot: Robot, shape: HopShape, seed: int) -> None:
        super().__init__(robot, shape)
        self._rng = np.random.default_rng(seed)

    def reset(self, count: int) -> None:
        """Forget everything."""
        super().reset(count)
        self._seen: deque[tuple[Array, Array, Array]] = deque(maxlen=DELAY + 1)
        self._sent: deque[Array] = deque(maxlen=DELAY)
        self._error = np.zeros((count, 3))
        self._memory = np.zeros(count, stepper.MEMORY)

    def look(self) -> tuple[Array, Array, Array]:
        """Return state, accelerations and torques as it knows them."""
        count = len(self._error)
        if self._seen:
            self._sent.append(self._torque.copy())
        self._seen.append(super().look())
        state, acceleration, motor = (part.copy() for part in self._seen[0])
        memory, nothing = self._memory, np.zeros(count)
        memory[:] = np.zeros((), stepper.MEMORY)
        memory["acceleration"], memory["motor_torque"] = acceleration, motor
        past, command = np.empty((count, 0, 6)), np.zeros((count, stepper.COMMAND))
        for torque in self._sent:
            command[:, :2] = torque
            stepper.step_legs(
                self._table, state, memory, past, command, nothing, nothing, 0, count,
                self._steps, self.timestep,
            )  # fmt: skip
        fresh = np.sqrt(1 - _LASTING**2) * self._rng.normal(size=(count, 3))
        self._error = _LASTING * self._error + fresh
        least, share = _SPEED_ERROR
        state[:, 3] += self._error[:, 0] * (least + share * np.abs(state[:, 3]))
        state[:, 4:] += self._error[:, 1:] * _JOINT_SPEED_ERROR
        return state, memory["acceleration"].copy(), memory["motor_torque"].copy()

    def state(self) -> dict[str, Any]:
        """Refuse: a search never goes on in the middle of a hop."""
        raise NotImplementedError
