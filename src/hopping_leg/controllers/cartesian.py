"""Cartesian stiffness control of the foot through the transposed Jacobian (paper, Eq. 7)."""

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.robot import kinematics
from hopping_leg.robot.parameters import Robot


def foot_force_torque(robot: Robot, q: Array, push: Array, side: Array) -> Array:
    """Return the joint torques that press the foot with a force, N m, (n, 2).

    The Jacobian is that of (x_down, y), so a positive ``push`` presses the foot to the ground.

    Args:
        robot: The leg.
        q: Joint positions, rad, (n, 2).
        push: Force downwards, N, (n,).
        side: Force forwards, N, (n,).
    """
    force = np.stack(np.broadcast_arrays(push, side), axis=-1)
    torque: Array = np.einsum("nij,ni->nj", kinematics.jacobian(robot, q), force)
    return torque


def leg_force(robot: Robot, q: Array, torque: Array) -> Array:
    """Return the force along the leg that joint torques press with at rest, N, (n,).

    The straight leg is singular; there the force of a slightly bent one is returned.

    Args:
        robot: The leg.
        q: Joint positions, rad, (n, 2).
        torque: At the joints, N m, (n, 2).
    """
    jacobian = kinematics.jacobian(robot, q)
    (a, b), (c, d) = np.moveaxis(jacobian, 0, -1)
    determinant = a * d - b * c
    least = 0.1 * robot.thigh.length * robot.shank.length
    bounded = np.where(determinant < 0, -1.0, 1.0) * np.maximum(np.abs(determinant), least)
    force: Array = (d * torque[:, 0] - c * torque[:, 1]) / bounded
    return force
