"""Where an episode begins: standing, or dropped in a random posture."""

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.envs.task_config import TaskConfig
from hopping_leg.errors import UsageError
from hopping_leg.robot import Robot, kinematics

_STANDING_SHARE = 0.3
"""Of the starts ``hop``."""

_NEAR_APEX = (-0.06, 0.03)
"""Where the other starts ``hop`` begin, relative to the commanded apex, m."""


class ResetSampler:
    """Draws initial states.

    Raises:
        RobotError: The robot is no leg.
        UsageError: A start asks for a leg length that the robot does not reach.
    """

    def __init__(self, robot: Robot, config: TaskConfig) -> None:
        robot.require_leg()
        self.robot, self.config = robot, config
        lengths = (config.start_length, *config.drop_length)
        self._standing = kinematics.joint_angles(robot, np.array([lengths[0], 0.0]))
        reach = robot.thigh.length + robot.shank.length
        if np.isnan(self._standing).any() or not all(0 < length < reach for length in lengths):
            raise UsageError(
                f"The starting leg lengths {lengths} m do not all lie within reach of {robot.name};"
                f" take lengths below {reach:g} m."
            )

    def draw(self, command: Array, rng: np.random.Generator) -> tuple[Array, Array]:
        """Draw one state at rest for each desired height.

        Args:
            command: Desired heights, m, (k,).
            rng: Source of randomness.

        Returns:
            Base heights, m, (k,), and joint angles, rad, (k, 2).
        """
        count, kind = len(command), self.config.reset_distribution
        if kind == "standing":
            q = np.tile(self._standing, (count, 1))
            return kinematics.stance_height(self.robot, q), q
        q, gap = self._drop(count, rng)
        if kind == "mixed":
            stands = rng.random(count) < 0.5
            q[stands], gap[stands] = self._standing, 0.0
        standing = kinematics.stance_height(self.robot, q)
        if kind != "hop":
            return standing + gap, q
        stands = rng.random(count) < _STANDING_SHARE
        apex = command + rng.uniform(*_NEAR_APEX, count)
        return np.where(stands, standing, np.maximum(standing, apex)), q

    def _drop(self, count: int, rng: np.random.Generator) -> tuple[Array, Array]:
        config = self.config
        length = rng.uniform(*config.drop_length, count)
        offset = rng.uniform(-config.drop_offset, config.drop_offset, count)
        q = kinematics.joint_angles(self.robot, np.stack([length, offset], axis=-1))
        q = np.clip(q, self.robot.of_joints("lower"), self.robot.of_joints("upper"))
        return q, rng.uniform(0.0, config.drop_clearance, count)
