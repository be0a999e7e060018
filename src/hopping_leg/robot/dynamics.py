"""Rigid-body dynamics of the leg in closed form.

Generalised coordinates are the base height x and the joint angles, p = (x, q1, q2); the equations
of motion in the air, without friction, are M(p) p'' + b(p, p') = (0, tau1, tau2). The links swing
in the rail's plane; with l the thigh's length, c1 and c2 the distances of the centres of mass from
the links' upper joints, s12 = sin(q1 + q2) and so on:

    height of thigh CoM: x - c1 cos q1             height of shank CoM: x - l cos q1 - c2 cos q12
    forward:             c1 sin q1                 forward:             l sin q1 + c2 sin q12

Armature, the motors' reflected inertia, adds to the diagonal of M: the rotors turn with the joints
but do not react on the links (as in MuJoCo). Joint angles, rad, and velocities, rad/s, are
(..., 2) throughout, base heights, m, (...).
"""

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.robot.model import GRAVITY
from hopping_leg.robot.parameters import Robot


def mass_matrix(robot: Robot, q: Array) -> Array:
    """Return the mass matrix over (rail, hip, knee), (..., 3, 3), kg, kg m and kg m2."""
    thigh, shank = robot.thigh, robot.shank
    lever = shank.mass * shank.com
    coupling = lever * thigh.length * np.cos(q[..., 1])
    shank_inertia = shank.inertia + lever * shank.com
    thigh_inertia = thigh.inertia + thigh.mass * thigh.com**2 + shank.mass * thigh.length**2
    rail_hip, rail_knee = _rail_coupling(robot, q)
    matrix: Array = np.empty((*q.shape[:-1], 3, 3))
    matrix[..., 0, 0] = robot.mass
    matrix[..., 0, 1] = matrix[..., 1, 0] = rail_hip
    matrix[..., 0, 2] = matrix[..., 2, 0] = rail_knee
    matrix[..., 1, 1] = thigh_inertia + shank_inertia + 2 * coupling + robot.hip.armature
    matrix[..., 1, 2] = matrix[..., 2, 1] = shank_inertia + coupling
    matrix[..., 2, 2] = shank_inertia + robot.knee.armature
    return matrix


def gravity_force(robot: Robot, q: Array) -> Array:
    """Return the forces that hold the leg against gravity, dV/dp, (..., 3), N and N m."""
    rail = np.full(q.shape[:-1], robot.mass)
    return GRAVITY * np.stack([rail, *_rail_coupling(robot, q)], axis=-1)


def bias_force(robot: Robot, q: Array, qd: Array) -> Array:
    """Return gravity, Coriolis and centrifugal forces b(p, p'), (..., 3), N and N m."""
    thigh, shank = robot.thigh, robot.shank
    q1, q2, q12 = q[..., 0], q[..., 1], q[..., 0] + q[..., 1]
    w1, w2, w12 = qd[..., 0], qd[..., 1], qd[..., 0] + qd[..., 1]
    lever = shank.mass * shank.com
    thigh_lever = thigh.mass * thigh.com + shank.mass * thigh.length
    bend = lever * thigh.length * np.sin(q2)
    rail = thigh_lever * np.cos(q1) * w1**2 + lever * np.cos(q12) * w12**2
    hip = -bend * w2 * (2 * w1 + w2)
    knee = bend * w1**2
    return gravity_force(robot, q) + np.stack([rail, hip, knee], axis=-1)


def _rail_coupling(robot: Robot, q: Array) -> tuple[Array, Array]:
    """Return the first moments of mass about hip and knee, kg m, (...)."""
    thigh, shank = robot.thigh, robot.shank
    knee = shank.mass * shank.com * np.sin(q[..., 0] + q[..., 1])
    thigh_lever = thigh.mass * thigh.com + shank.mass * thigh.length
    return thigh_lever * np.sin(q[..., 0]) + knee, knee
