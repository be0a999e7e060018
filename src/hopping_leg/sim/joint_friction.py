"""Joint friction that changes while legs move: gears rub more the more torque they pass on."""

from collections.abc import Sequence

import numpy as np
from mujoco import batch

from hopping_leg.arrays import Array, IntArray
from hopping_leg.robot.parameters import Robot


class JointFriction:
    """Sets MuJoCo's friction loss, whose solver holds a joint at rest.

    Args:
        robots: The leg of each simulation, n of them.
        simulation: The legs.
        joints: Degrees of freedom of hip and knee, (2,).
    """

    def __init__(self, robots: Sequence[Robot], simulation: batch.Batch, joints: IntArray) -> None:
        self._coulomb, self._load = (
            np.array([robot.of_joints(name) for robot in robots])
            for name in ("friction", "load_friction")
        )
        self._joints, self._loss = joints, simulation.expand("dof_frictionloss")

    def set(self, torque: Array, further: Array | float = 0.0) -> None:
        """Let the joints rub.

        Args:
            torque: That the motors give, N m at the joints, (n, 2).
            further: Friction beside Coulomb's and the load's, N m, (n, 2).
        """
        self._loss[:, self._joints] = self._coulomb + self._load * np.abs(torque) + further


def rubs_under_load(robots: Sequence[Robot]) -> bool:
    """Tell whether any leg's gears do."""
    return any(robot.of_joints("load_friction").any() for robot in robots)
