"""Kinematics of the leg in closed form.

The foot in the hip's frame: x_down = L1 cos q1 + L2 cos(q1 + q2), y = L1 sin q1 + L2 sin(q1 + q2).
The paper's base height x is the height of the hip axis above the ground.
"""

from dataclasses import dataclass

import numpy as np

from hopping_leg.arrays import Array, IntArray
from hopping_leg.robot.parameters import Robot


@dataclass(frozen=True)
class Lengths:
    """Links of n legs."""

    length: Array
    """(n,), m."""


@dataclass(frozen=True)
class Radii:
    """Balls of n legs."""

    radius: Array
    """(n,), m."""


@dataclass(frozen=True)
class LegGeometry:
    """Lengths of n legs that differ; angles and heights given with it have n rows."""

    thigh: Lengths
    shank: Lengths
    foot: Radii
    knee_cap: Radii
    base: Radii

    def rows(self, ids: IntArray) -> "LegGeometry":
        """Return some of the legs."""
        thigh, shank = (Lengths(link.length[ids]) for link in (self.thigh, self.shank))
        balls = (Radii(ball.radius[ids]) for ball in (self.foot, self.knee_cap, self.base))
        return LegGeometry(thigh, shank, *balls)


Geometry = Robot | LegGeometry
"""What kinematics depend on."""


def foot_position(robot: Geometry, q: Array) -> Array:
    """Return the foot's centre in the hip's frame, (x_down, y), m, (..., 2); angles in rad."""
    thigh, shank = robot.thigh.length, robot.shank.length
    q1, q12 = q[..., 0], q[..., 0] + q[..., 1]
    down = thigh * np.cos(q1) + shank * np.cos(q12)
    forward = thigh * np.sin(q1) + shank * np.sin(q12)
    return np.stack([down, forward], axis=-1)


def joint_angles(robot: Geometry, foot: Array) -> Array:
    """Return angles, rad, (..., 2), q2 <= 0, for a foot at (x_down, y), m; NaN out of reach."""
    thigh, shank = robot.thigh.length, robot.shank.length
    square = np.sum(np.square(foot), axis=-1)
    cosine = (square - thigh**2 - shank**2) / (2 * thigh * shank)
    rounding = 1e-12
    reachable = np.abs(cosine) <= 1 + rounding
    knee = -np.arccos(np.clip(cosine, -1, 1))
    hip = np.arctan2(foot[..., 1], foot[..., 0]) - np.arctan2(
        shank * np.sin(knee), thigh + shank * np.cos(knee)
    )
    hip = np.remainder(hip + np.pi, 2 * np.pi) - np.pi
    angles = np.stack([hip, knee], axis=-1)
    return np.where(reachable[..., None], angles, np.nan)


def jacobian(robot: Geometry, q: Array) -> Array:
    """Return d(x_down, y)/d(q1, q2), m/rad, (..., 2, 2)."""
    foot, q12 = foot_position(robot, q), q[..., 0] + q[..., 1]
    down = np.stack([-foot[..., 1], -robot.shank.length * np.sin(q12)], axis=-1)
    forward = np.stack([foot[..., 0], robot.shank.length * np.cos(q12)], axis=-1)
    return np.stack([down, forward], axis=-2)


def foot_velocity(robot: Geometry, q: Array, qd: Array) -> Array:
    """Return the foot's velocity in the hip's frame, (x_down, y) rates, m/s, (..., 2)."""
    return np.asarray(np.einsum("...ij,...j->...i", jacobian(robot, q), qd))


def stance_height(robot: Geometry, q: Array) -> Array:
    """Return the base height if the foot stands on flat, hard ground, m, (...)."""
    lengths = np.stack([robot.thigh.length, robot.shank.length], axis=-1)
    height: Array = np.vecdot(np.cos(np.add.accumulate(q, axis=-1)), lengths) + robot.foot.radius
    return height


def foot_clearance(robot: Geometry, height: Array, q: Array) -> Array:
    """Return the gap between the foot and the ground, m, (...); negative when it sinks in."""
    return height - stance_height(robot, q)


def knee_clearance(robot: Geometry, height: Array, q: Array) -> Array:
    """Return the gap between the knee and the ground, m, (...)."""
    return height - robot.thigh.length * np.cos(q[..., 0]) - robot.knee_cap.radius


def base_clearance(robot: Geometry, height: Array) -> Array:
    """Return the gap between the base and the ground, m, (...)."""
    return height - robot.base.radius


def smooth_step(share: Array) -> Array:
    """Return the path of least jerk from 0 to 1, at rest at both ends, (...)."""
    s = np.clip(share, 0.0, 1.0)
    return s**3 * (10 - 15 * s + 6 * s**2)


def smooth_step_rate(share: Array) -> Array:
    """Return the derivative of ``smooth_step``, (...)."""
    s = np.clip(share, 0.0, 1.0)
    return 30 * s**2 * (1 - s) ** 2
