"""A teacher as a controller: what feedback of the full state comes to."""

import hashlib
import math

import numpy as np
import torch

from hopping_leg.arrays import Array
from hopping_leg.controllers.observation_history import make_observation_history
from hopping_leg.envs import TaskConfig
from hopping_leg.envs.observation import PRIVILEGED, privileged_observation, sample_scaling
from hopping_leg.rl.distillation.teacher_student import TeacherStudentPolicy
from hopping_leg.robot.parameters import Robot
from hopping_leg.sim import Measurement, Simulator

_LASTING = 0.8
"""Share of an error that is left after a tick: a policy that has misjudged the state goes on to."""


class Teacher:
    """Sees the true state of simulated legs, without noise or delay; its torques are disturbed.

    Args:
        policy: Whose teacher it is.
        robot: The leg that it learns on.
        options: The learning problem.
        action_noise: Standard deviation of what is added to its torques, of the largest: errors as
            somebody makes who imitates it, which last for some ticks.
    """

    name = "true-state"

    def __init__(
        self,
        policy: TeacherStudentPolicy,
        robot: Robot,
        options: TaskConfig,
        action_noise: float = 0.0,
    ) -> None:
        self._policy, self._action_noise = policy, action_noise
        self._last_torque = last_torque(options)
        self._sample = sample_scaling(robot, options)
        self._torque = np.array(options.action_torque)
        self.command_range = options.command_bounds
        """Heights it was made for, m."""

    @property
    def digest(self) -> str:
        """First 16 hex digits of its weights' SHA-256."""
        weights = hashlib.sha256()
        for value in self._policy.state_dict().values():
            weights.update(value.numpy().tobytes())
        return weights.hexdigest()[:16]

    def watch(self, legs: Simulator) -> None:
        """Set the legs whose state it sees."""
        self._legs = legs

    def reset(self, count: int) -> None:
        """Forget its last action; the errors begin anew, the same ones every time."""
        self._last, self._error = np.zeros((count, 2)), np.zeros((count, 2))
        self._rng = np.random.default_rng(0)

    def act(self, measurement: Measurement) -> Array:
        """Return joint torques, N m, (n, 2)."""
        count = len(self._last)
        seen = np.zeros((count, self._policy.features_dim), np.float32)
        first = self._policy.measured
        seen[:, self._last_torque] = self._last
        state = seen[:, first : first + PRIVILEGED]
        privileged_observation(self._legs, measurement.command[:, 0], self._sample, out=state)
        with torch.no_grad():
            self._last = self._policy.teacher_action(torch.from_numpy(seen)).double().numpy()
        if self._action_noise > 0:
            spread = self._action_noise * math.sqrt(1 - _LASTING**2)
            self._error = _LASTING * self._error + spread * self._rng.normal(size=(count, 2))
            self._last = (self._last + self._error).clip(-1, 1)
        torque: Array = self._last * self._torque
        return torque

    def internals(self) -> dict[str, Array]:
        """Return nothing."""
        return {}


def last_torque(task: TaskConfig) -> list[int]:
    """Return where the torques of the last control step stand in an observation, if they do."""
    shapes = make_observation_history(task.observation, 1 / task.rate).shapes
    if "past_torque" not in shapes:
        return []
    before = list(shapes)[: list(shapes).index("past_torque")]
    first = sum(int(np.prod(shapes[name])) for name in before)
    return [first, first + 1]
