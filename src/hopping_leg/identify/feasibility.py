"""Whether a leg can follow a trajectory: reach, joint range, speed, torque; before it is played."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hopping_leg.arrays import Array, BoolArray
from hopping_leg.errors import UsageError
from hopping_leg.identify.recording_format import Pair, Rig
from hopping_leg.robot import dynamics, kinematics
from hopping_leg.robot.limits import MotorLimit
from hopping_leg.robot.parameters import JOINTS, Robot

LEAST_CLEARANCE = 0.005
"""Least clearance of base and knee above the ground, m."""


@dataclass(frozen=True)
class HardwareRange:
    """How far the joints of the real leg turn; wider than a robot file's soft limits.

    The knee's default is what recordings of the leg show it can do, to either side.
    """

    hip: Pair = (-math.pi, math.pi)
    """rad; the hip turns freely, half a turn keeps cables from winding up."""
    knee: Pair = (-2.7, 2.7)
    """rad"""

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper limits of hip and knee, rad, (2,) each."""
        lower, upper = np.array([self.hip, self.knee]).T
        return lower, upper


@dataclass(frozen=True)
class Demand:
    """What a trajectory asks of the joints.

    Attributes:
        position: rad, (ticks, 2).
        velocity: rad/s, (ticks, 2).
        torque: N m, (ticks, 2).
        clearance: Height of base and knee above the ground on which the foot stands, m, (ticks, 2);
            infinite where the base is clamped.
    """

    position: Array
    velocity: Array
    torque: Array
    clearance: Array


def inverse_dynamics(robot: Robot, rig: Rig, q: Array, qd: Array, qdd: Array) -> Array:
    """Return the joint torques of a motion, N m, (..., 2).

    With a moving base the foot presses on flat, hard ground with the force F that the motion
    takes, without horizontal force; where F would pull, the leg flies. Landing impacts are not
    part of this.

    Args:
        robot: The leg.
        rig: Whether the base is clamped.
        q: Joint angles, rad, (..., 2).
        qd: Joint velocities, rad/s, (..., 2).
        qdd: Joint accelerations, rad/s2, (..., 2).
    """
    mass, bias = dynamics.mass_matrix(robot, q), dynamics.bias_force(robot, q, qd)
    torque: Array = np.einsum("...ij,...j->...i", mass[..., 1:, 1:], qdd) + bias[..., 1:]
    if rig != "fixed-base":
        down = kinematics.jacobian(robot, q)[..., 0, :]
        inner = np.vecdot(mass[..., 0, 1:], qdd) + bias[..., 0]
        climb = np.vecdot(down, qdd) + _centripetal(robot, q, qd)
        force = np.maximum(mass[..., 0, 0] * climb + inner, 0.0)
        climb = (force - inner) / mass[..., 0, 0]
        torque += mass[..., 1:, 0] * climb[..., None] + down * force[..., None]
    torque += robot.of_joints("friction") * np.sign(qd) + robot.of_joints("damping") * qd
    return torque


def demand(robot: Robot, rig: Rig, position: Array, rate: float) -> Demand:
    """Return speeds and torques of a sampled trajectory.

    Args:
        robot: The leg.
        rig: Whether the base is clamped.
        position: rad, (ticks, 2).
        rate: Samples per second, Hz.
    """
    velocity = np.gradient(position, 1 / rate, axis=0)
    inner = np.diff(position, 2, axis=0) * rate**2
    acceleration = np.pad(inner, ((1, 1), (0, 0)), mode="edge")
    torque = inverse_dynamics(robot, rig, position, velocity, acceleration)
    clearance = np.full_like(position, np.inf)
    if rig != "fixed-base":
        height = kinematics.stance_height(robot, position)
        clearance[:, 0] = kinematics.base_clearance(robot, height)
        clearance[:, 1] = kinematics.knee_clearance(robot, height, position)
    return Demand(position, velocity, torque, clearance)


def check_demand(robot: Robot, wanted: Demand, rate: float, limits: HardwareRange) -> None:
    """Refuse what the leg cannot do.

    Args:
        robot: The leg, for its motors' torque-speed lines.
        wanted: Speeds and torques.
        rate: Samples per second, Hz.
        limits: How far the real joints turn.

    Raises:
        UsageError: Naming joint, time and limit.
    """
    lower, upper = limits.bounds
    _refuse(np.isnan(wanted.position), rate, lambda _t, _j: "the foot is out of reach")
    _refuse(
        (wanted.position < lower) | (wanted.position > upper),
        rate,
        lambda t, j: (
            f"{wanted.position[t, j]:.2f} rad is outside of the hardware's range"
            f" {lower[j]:g} to {upper[j]:g} rad"
        ),
    )
    _refuse(
        wanted.clearance < LEAST_CLEARANCE,
        rate,
        lambda t, j: (
            f"the {('base', 'knee')[j]} is {wanted.clearance[t, j] * 1e3:.0f} mm above the ground,"
            f" below {LEAST_CLEARANCE * 1e3:g} mm"
        ),
    )
    fastest = robot.of_joints("no_load_speed")
    _refuse(
        np.abs(wanted.velocity) > fastest,
        rate,
        lambda t, j: f"{wanted.velocity[t, j]:.1f} rad/s exceeds {fastest[j]:g} rad/s",
    )
    possible = MotorLimit(robot).clip(wanted.torque, wanted.velocity)
    _refuse(
        np.abs(wanted.torque - possible) > 1e-9,
        rate,
        lambda t, j: (
            f"{wanted.torque[t, j]:.1f} N m at {wanted.velocity[t, j]:.1f} rad/s exceeds the"
            f" {possible[t, j]:.1f} N m that the motor gives"
        ),
    )


def _centripetal(robot: Robot, q: Array, qd: Array) -> Array:
    """Return the foot's downward acceleration at zero joint acceleration, m/s2, (...)."""
    angle, speed = np.cumsum(q, axis=-1), np.cumsum(qd, axis=-1)
    lengths = np.array([robot.thigh.length, robot.shank.length])
    downward: Array = -np.vecdot(np.cos(angle) * speed**2, lengths)
    return downward


def _refuse(bad: BoolArray, rate: float, reason: Callable[[int, int], str]) -> None:
    if not bad.any():
        return
    tick, joint = (int(index) for index in np.argwhere(bad)[0])
    raise UsageError(
        f"The leg cannot follow the trajectory: at {tick / rate:.3f} s, {JOINTS[joint]}:"
        f" {reason(tick, joint)}; lower the amplitude, slow it down or adapt it."
    )
