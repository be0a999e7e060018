"""The leg as energy shaping sees it: one virtual leg from the hip to the foot, and its posture.

The foot is pressed through the transposed Jacobian (paper, Eq. 7); in flight the joints move to the
landing posture on a smooth path, held there by a PD.
"""

from dataclasses import dataclass

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.controllers.energy_shaping.gains import Gain, ShapingGains
from hopping_leg.controllers.energy_shaping.observer import JointState
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


def retraction(start: Array, end: Array, elapsed: Array, duration: Gain) -> tuple[Array, Array]:
    """Return where the joints should be and how fast, rad and rad/s, (n, 2).

    Args:
        start: Joint positions at lift-off, rad, (n, 2).
        end: Landing posture, rad, (n, 2).
        elapsed: Time since lift-off, s, (n,).
        duration: Duration of the movement, s.
    """
    lasts = np.broadcast_to(duration, elapsed.shape)[:, None]
    share = elapsed[:, None] / lasts
    rate = (end - start) * kinematics.smooth_step_rate(share) / lasts
    return start + (end - start) * kinematics.smooth_step(share), rate


def flight_torque(gains: ShapingGains, leg: LegView, target: Array, rate: Array) -> Array:
    """Return the torques of the flight PD towards a posture that moves, N m, (n, 2)."""
    torque = per_joint(gains.hip_stiffness, gains.knee_stiffness) * (target - leg.q)
    torque += per_joint(gains.hip_damping, gains.knee_damping) * (rate - leg.qd)
    return torque


def per_joint(hip: Gain, knee: Gain) -> Array:
    """Return a gain of both joints, (2,) or (n, 2)."""
    return np.stack(np.broadcast_arrays(np.asarray(hip, float), np.asarray(knee, float)), axis=-1)
