"""In which states episodes begin."""

from collections.abc import Sequence

import numpy as np

from hopping_leg.arrays import Array, IntArray
from hopping_leg.controllers import robot_numbers
from hopping_leg.envs.task_config import ResetDistribution
from hopping_leg.errors import RobotError
from hopping_leg.robot import Robot, kinematics
from hopping_leg.robot.kinematics import LegGeometry

_PAPER_LENGTH = 0.15 + 0.14
"""Stretched length of the paper's leg, m, for which the following lengths, m, are; they grow with
the leg. A leg's length is that from the hip to the foot's centre."""
_STANDING_LENGTH = 0.2  # foot below the hip
_DROP_LENGTH, _DROP_OFFSET = (0.15, 0.25), 0.02
_DROP_CLEARANCE = 0.1  # at most, under the foot
_NEAR_APEX = (-0.06, 0.03)  # Where most starts ``hop`` begin, relative to the commanded apex
_STANDING_SHARE = 0.3  # of the starts ``hop``


def standing_length(robot: Robot) -> float:
    """Return the leg length of a standing start, m."""
    return _STANDING_LENGTH * robot_numbers.leg_length(robot) / _PAPER_LENGTH


class InitialStates:
    """Draws initial states: standing, or dropped in a random posture.

    ``believed`` is what is told of each leg, ``geometry`` the legs'. RobotError says that the robot
    is no leg, or cannot fold to the length in which it stands.
    """

    def __init__(
        self,
        robot: Robot,
        kind: ResetDistribution,
        believed: Sequence[Robot],
        geometry: kinematics.Geometry,
    ) -> None:
        robot.require_leg()
        self._robot, self._kind, self._geometry = robot, kind, geometry
        lengths = np.array([robot_numbers.leg_length(one) for one in believed])
        self._scale = lengths / _PAPER_LENGTH
        length = standing_length(robot)
        self._standing = kinematics.joint_angles(robot, np.array([length, 0.0]))
        if np.isnan(self._standing).any():
            raise RobotError(f"{robot.name} cannot stand: its leg does not fold to {length:g} m.")

    def draw(self, rows: IntArray, command: Array, rng: np.random.Generator) -> tuple[Array, Array]:
        """Draw base heights, m, (k,), and joint angles, rad, (k, 2), for desired heights, m."""
        count, kind = len(command), self._kind
        leg, scale = self._geometry, self._scale[rows]
        if isinstance(leg, LegGeometry):
            leg = leg.rows(rows)
        if kind == "standing":
            q = np.tile(self._standing, (count, 1))
            return kinematics.stance_height(leg, q), q
        length = scale * rng.uniform(*_DROP_LENGTH, count)
        offset = scale * rng.uniform(-_DROP_OFFSET, _DROP_OFFSET, count)
        q = kinematics.joint_angles(leg, np.stack([length, offset], axis=-1))
        q = np.clip(q, self._robot.of_joints("lower"), self._robot.of_joints("upper"))
        gap = scale * rng.uniform(0.0, _DROP_CLEARANCE, count)
        if kind == "mixed":
            stands = rng.random(count) < 0.5
            q[stands], gap[stands] = self._standing, 0.0
        standing = kinematics.stance_height(leg, q)
        if kind != "hop":
            return standing + gap, q
        stands = rng.random(count) < _STANDING_SHARE
        apex = command + scale * rng.uniform(*_NEAR_APEX, count)
        return np.where(stands, standing, np.maximum(standing, apex)), q
