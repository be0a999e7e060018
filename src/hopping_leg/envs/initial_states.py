"""In which states episodes begin."""

import numpy as np

from hopping_leg import errors
from hopping_leg.arrays import Array, IntArray
from hopping_leg.envs import task_config
from hopping_leg.robot import Robot, kinematics
from hopping_leg.robot.kinematics import LegGeometry

_STANDING_SHARE = 0.3  # of the starts ``hop``

_NEAR_APEX = (-0.06, 0.03)
"""Where the other starts ``hop`` begin, relative to the commanded apex, m."""


class InitialStates:
    """Draws initial states: standing, or dropped in a random posture.

    ``geometry`` is the legs', ``scale`` that of the lengths of ``config`` for each, (n,).

    Raises:
        RobotError: The robot is no leg.
        UsageError: A start asks for a leg length that the robot does not reach.
    """

    def __init__(
        self,
        robot: Robot,
        config: task_config.TaskConfig,
        geometry: kinematics.Geometry,
        scale: Array,
    ) -> None:
        robot.require_leg()
        self.robot, self.config = robot, config
        self._geometry, self._scale = geometry, scale
        lengths = (config.start_length, *config.drop_length)
        self._standing = kinematics.joint_angles(robot, np.array([lengths[0], 0.0]))
        reach = robot.thigh.length + robot.shank.length
        if np.isnan(self._standing).any() or not all(0 < length < reach for length in lengths):
            raise errors.UsageError(
                f"The starting leg lengths {lengths} m do not all lie within reach of {robot.name};"
                f" take lengths below {reach:g} m."
            )

    def draw(self, rows: IntArray, command: Array, rng: np.random.Generator) -> tuple[Array, Array]:
        """Draw base heights, m, (k,), and joint angles, rad, (k, 2), for desired heights, m."""
        count, kind = len(command), self.config.reset_distribution
        leg, scale = self._geometry, self._scale[rows]
        if isinstance(leg, LegGeometry):
            leg = leg.rows(rows)
        if kind == "standing":
            q = np.tile(self._standing, (count, 1))
            return kinematics.stance_height(leg, q), q
        q, gap = self._drop(leg, scale, count, rng)
        if kind == "mixed":
            stands = rng.random(count) < 0.5
            q[stands], gap[stands] = self._standing, 0.0
        standing = kinematics.stance_height(leg, q)
        if kind != "hop":
            return standing + gap, q
        stands = rng.random(count) < _STANDING_SHARE
        apex = command + scale * rng.uniform(*_NEAR_APEX, count)
        return np.where(stands, standing, np.maximum(standing, apex)), q

    def _drop(
        self, leg: kinematics.Geometry, scale: Array, count: int, rng: np.random.Generator
    ) -> tuple[Array, Array]:
        config = self.config
        length = scale * rng.uniform(*config.drop_length, count)
        offset = scale * rng.uniform(-config.drop_offset, config.drop_offset, count)
        q = kinematics.joint_angles(leg, np.stack([length, offset], axis=-1))
        q = np.clip(q, self.robot.of_joints("lower"), self.robot.of_joints("upper"))
        return q, scale * rng.uniform(0.0, config.drop_clearance, count)
