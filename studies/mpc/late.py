"""MPC that sees as little as a policy does: late, and with errors about velocities."""

from collections import deque
from typing import Any

import numpy as np

from hopping_leg.arrays import Array, Records
from hopping_leg.controllers.mpc import HopShape, TrueStateMpc
from hopping_leg.robot import Robot
from hopping_leg.sim import stepper

DELAY = 2
"""Control periods by which the state is late; the commands since are known."""

_SPEED_ERROR = (0.015, 0.019)
"""Error of the base's velocity: so much, m/s, and so much of its value. With these numbers hops
scatter about as those of the distilled policies do."""

_JOINT_SPEED_ERROR = 0.1  # rad/s
_LASTING = 0.7  # share of an error that is left a control period later


class LateMpc(TrueStateMpc):
    """Plans from the state two control periods ago, carried forward, with errors of velocities."""

    name = "late-mpc"

    def __init__(self, robot: Robot, shape: HopShape, seed: int) -> None:
        super().__init__(robot, shape)
        self._rng = np.random.default_rng(seed)

    def reset(self, count: int) -> None:
        """Forget everything."""
        super().reset(count)
        self._seen: deque[tuple[Array, Records]] = deque(maxlen=DELAY + 1)
        self._sent: deque[Array] = deque(maxlen=DELAY)
        self._error = np.zeros((count, 3))

    def look(self) -> tuple[Array, Records]:
        """Return states and memory as it knows them."""
        count = len(self._error)
        if self._seen:
            self._sent.append(self._torque.copy())
        state, memory = super().look()
        self._seen.append((state.copy(), memory.copy()))
        state, memory = self._seen[0][0].copy(), self._seen[0][1].copy()
        nothing, past = np.zeros(count), np.empty((count, 0, 6))
        command = np.zeros((count, stepper.COMMAND))
        for torque in self._sent:
            command[:, :2] = torque
            stepper.step_legs(
                self._ground, state, memory, past, command, nothing, nothing, 0, count,
                int(self._steps[0]), self.period / int(self._steps[0]),
            )  # fmt: skip
        fresh = np.sqrt(1 - _LASTING**2) * self._rng.normal(size=(count, 3))
        self._error = _LASTING * self._error + fresh
        least, share = _SPEED_ERROR
        state[:, 3] += self._error[:, 0] * (least + share * np.abs(state[:, 3]))
        state[:, 4:] += self._error[:, 1:] * _JOINT_SPEED_ERROR
        return state, memory

    def state(self) -> dict[str, Any]:
        """Refuse: a search never goes on in the middle of a hop."""
        raise NotImplementedError
