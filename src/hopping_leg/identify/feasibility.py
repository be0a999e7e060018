"""Whether a leg can follow a trajectory: reach, joint range, speed, torque; before it is played."""

from dataclasses import dataclass

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.errors import UsageError
from hopping_leg.identify.recording_format import Pair, Rig
from hopping_leg.robot import JOINTS, MotorLimit, Robot, dynamics, kinematics

LEAST_CLEARANCE = 0.005  # of base and knee above the ground, m


@dataclass(frozen=True)
class HardwareRange:
    """How far the joints of the real leg turn; wider than a robot file's soft limits.

    The knee's default is what recordings of the leg show it can do, to either side.
    """

    hip: Pair = (-np.pi, np.pi)
    """rad; the hip turns freely, half a turn keeps cables from winding up."""
    knee: Pair = (-2.7, 2.7)
    """rad"""


@dataclass(frozen=True)
class Demand:
    """What a trajectory asks of the joints, rad, rad/s and N m, (ticks, 2) each."""

    position: Array
    velocity: Array
    torque: Array
    clearance: Array
    """Height of base and knee above the ground on which the foot stands, m; infinite where the base
    is clamped."""


def inverse_dynamics(robot: Robot, rig: Rig, q: Array, qd: Array, qdd: Array) -> Array:
    """Return the joint torques, N m, of joint angles, velocities and accelerations, (..., 2) each.

    With a moving base the foot presses on flat, hard ground with the force F that the motion
    takes, without horizontal force; where F would pull, the leg flies. Landing impacts are not
    part of this.
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
    """Return what a trajectory, rad, (ticks, 2), sampled at a rate in Hz, asks of the joints."""
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
    """Raise UsageError for what range, ground or torque-speed lines forbid, by joint and time."""
    lower, upper = np.array([limits.hip, limits.knee]).T
    fastest = robot.of_joints("no_load_speed")
    possible = MotorLimit(robot).clip(wanted.torque, wanted.velocity)
    outside = (wanted.position < lower) | (wanted.position > upper)
    facts = {
        "angle": wanted.position,
        "speed": wanted.velocity,
        "torque": wanted.torque,
        "possible": possible,
        "lower": lower,
        "upper": upper,
        "fastest": fastest,
        "part": np.array(["base", "knee"]),
        "clearance": wanted.clearance * 1e3,
        "least": LEAST_CLEARANCE * 1e3,
    }
    for bad, reason in (
        (np.isnan(wanted.position), "the foot is out of reach"),
        (
            outside,
            "{angle:.2f} rad is outside of the hardware's range {lower:g} to {upper:g} rad",
        ),
        (
            wanted.clearance < LEAST_CLEARANCE,
            "the {part} is {clearance:.0f} mm above the ground, below {least:g} mm",
        ),
        (np.abs(wanted.velocity) > fastest, "{speed:.1f} rad/s exceeds {fastest:g} rad/s"),
        (
            np.abs(wanted.torque - possible) > 1e-9,
            "{torque:.1f} N m at {speed:.1f} rad/s exceeds the {possible:.1f} N m that the motor"
            " gives",
        ),
    ):
        if bad.any():
            tick, joint = np.argwhere(bad)[0].tolist()
            at = {k: np.broadcast_to(v, bad.shape)[tick, joint] for k, v in facts.items()}
            raise UsageError(
                f"The leg cannot follow the trajectory: at {tick / rate:.3f} s, {JOINTS[joint]}:"
                f" {reason.format(**at)}; lower the amplitude, slow it down or adapt it."
            )


def _centripetal(robot: Robot, q: Array, qd: Array) -> Array:
    """Return the foot's downward acceleration at zero joint acceleration, m/s2, (...)."""
    angle, speed = np.cumsum(q, axis=-1), np.cumsum(qd, axis=-1)
    lengths = np.array([robot.thigh.length, robot.shank.length])
    downward: Array = -np.vecdot(np.cos(angle) * speed**2, lengths)
    return downward
