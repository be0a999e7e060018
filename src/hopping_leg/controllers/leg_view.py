"""The leg as energy shaping sees it: one virtual leg from the hip to the foot."""

from dataclasses import dataclass

from hopping_leg.arrays import Array
from hopping_leg.controllers.joint_observer import JointState
from hopping_leg.robot import kinematics
from hopping_leg.robot.parameters import Robot


@dataclass(frozen=True)
class LegView:
    """State of n legs, all estimated.

    Attributes:
        q: Joint positions, rad, (n, 2).
        qd: Joint velocities, rad/s, (n, 2).
        length: Distance of the foot below the hip, m, (n,).
        rate: Its derivative, m/s, (n,).
        y: Forward offset of the foot, m, (n,).
        y_rate: Its derivative, m/s, (n,).
        stand: Base height if the foot stood on hard ground, m, (n,).
    """

    q: Array
    qd: Array
    length: Array
    rate: Array
    y: Array
    y_rate: Array
    stand: Array


def view_leg(robot: Robot, joints: JointState) -> LegView:
    """Return the virtual leg of a joint state."""
    foot = kinematics.foot_position(robot, joints.q)
    speed = kinematics.foot_velocity(robot, joints.q, joints.qd)
    stand = foot[:, 0] + robot.foot.radius
    return LegView(joints.q, joints.qd, foot[:, 0], speed[:, 0], foot[:, 1], speed[:, 1], stand)
