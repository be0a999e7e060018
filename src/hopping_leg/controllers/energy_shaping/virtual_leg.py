"""The leg as energy shaping sees it: one virtual leg from the hip to the foot, and its posture.

The foot is pressed through the transposed Jacobian (paper, Eq. 7); in flight the joints move to the
landing posture on a smooth path, held there by a PD.
"""

from dataclasses import dataclass

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.controllers.energy_shaping.gains import Gain, ShapingGains
from hopping_leg.robot import Robot, kinematics


@dataclass(frozen=True)
class LegView:
    """State of n legs, all estimated."""

    q: Array
    """Joint positions, rad, (n, 2)."""
    qd: Array
    """Joint velocities, rad/s, (n, 2)."""
    length: Array
    """Distance of the foot below the hip, m, (n,)."""
    rate: Array
    """Its derivative, m/s, (n,)."""
    y: Array
    """Forward offset of the foot, m, (n,)."""
    y_rate: Array
    """Its derivative, m/s, (n,)."""
    stand: Array
    """Base height if the foot stood on hard ground, m, (n,)."""


def view_leg(robot: Robot, q: Array, qd: Array) -> LegView:
    """Return the virtual leg of joint positions and velocities, rad, rad/s, (n, 2)."""
    foot = kinematics.foot_position(robot, q)
    speed = kinematics.foot_velocity(robot, q, qd)
    stand = foot[:, 0] + robot.foot.radius
    return LegView(q, qd, foot[:, 0], speed[:, 0], foot[:, 1], speed[:, 1], stand)


def foot_force_torque(robot: Robot, q: Array, push: Array, side: Array) -> Array:
    """Return the joint torques that press the foot with a force, N m, (n, 2).

    The Jacobian is that of (x_down, y), so a positive ``push`` presses the foot to the ground, N,
    (n,); ``side`` is the force forwards.
    """
    force = np.stack(np.broadcast_arrays(push, side), axis=-1)
    torque: Array = np.einsum("nij,ni->nj", kinematics.jacobian(robot, q), force)
    return torque


def leg_force(robot: Robot, q: Array, torque: Array) -> Array:
    """Return the force along the leg that joint torques press with at rest, N, (n,).

    Joint positions are in rad, torques in N m, (n, 2). The straight leg is singular; there the
    force of a slightly bent one is returned.
    """
    (a, b), (c, d) = np.moveaxis(kinematics.jacobian(robot, q), 0, -1)
    determinant = a * d - b * c
    least = 0.1 * robot.thigh.length * robot.shank.length
    bounded = np.where(determinant < 0, -1.0, 1.0) * np.maximum(np.abs(determinant), least)
    force: Array = (d * torque[:, 0] - c * torque[:, 1]) / bounded
    return force


def retraction(start: Array, end: Array, elapsed: Array, duration: Gain) -> tuple[Array, Array]:
    """Return where the joints should be and how fast, rad and rad/s, (n, 2); times are in s."""
    lasts = np.broadcast_to(duration, elapsed.shape)[:, None]
    share = elapsed[:, None] / lasts
    rate = (end - start) * kinematics.smooth_step_rate(share) / lasts
    return start + (end - start) * kinematics.smooth_step(share), rate


def flight_torque(gains: ShapingGains, leg: LegView, target: Array, rate: Array) -> Array:
    """Return the torques of the flight PD towards a posture that moves, N m, (n, 2)."""
    stiffness = np.broadcast_arrays(gains.hip_stiffness, gains.knee_stiffness)
    damping = np.broadcast_arrays(gains.hip_damping, gains.knee_damping)
    behind, slower = target - leg.q, rate - leg.qd
    return np.stack(stiffness, axis=-1) * behind + np.stack(damping, axis=-1) * slower
