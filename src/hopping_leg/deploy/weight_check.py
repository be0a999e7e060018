"""Whether a standing leg carries its weight as its robot's file says, before it may hop.

Under a leg that stands still, the torques of hip and knee tell the force of its foot on the ground.
It must be about the leg's weight, upward, or the joints are not what the file says: a wrong sign,
swapped drives, a wrong gear or belt of the knee, a wrong homing, or a foot that does not stand on
the ground. A wrong gear of the hip does not show: it turns the leg about its foot.
"""

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.robot import Robot, dynamics

UPWARD = (0.82, 2.0)
"""Shares of its file's weight that a leg may seem to carry; a payload adds to it."""

SIDEWAYS = 0.66
"""Largest share with which it may seem to push sideways, as a foot that was dragged into place."""


def foot_force(robot: Robot, q: Array, torque: Array) -> tuple[float, float]:
    """Return how a standing leg pushes forward and upward, over its weight.

    Args:
        robot: The leg as its file says.
        q: Joint angles, rad, (2,).
        torque: Joint torques, N m, (2,).
    """
    thigh, shank = robot.thigh.length, robot.shank.length
    hip, both = q[0], q[0] + q[1]
    lower = shank * np.array([np.cos(both), np.sin(both)])
    jacobian = np.stack([thigh * np.array([np.cos(hip), np.sin(hip)]) + lower, lower], axis=1)
    weight, *joints = dynamics.gravity_force(robot, q)
    forward, upward = np.linalg.solve(jacobian.T, np.array(joints) - torque) / weight
    return float(forward), float(upward)


def complaint(robot: Robot, forward: float, upward: float) -> str:
    """Return what is wrong with a foot's force over the weight, a sentence, or "" if nothing is."""
    least, most = UPWARD
    if least <= upward <= most and abs(forward) <= SIDEWAYS:
        return ""
    return (
        f"by the file of {robot.name} its foot pushes with {upward:.0%} of the weight upward and"
        f" {forward:.0%} forward; check signs, CAN ids, gears, belt and zeros of both joints, and"
        " that the foot stands on the ground"
    )
