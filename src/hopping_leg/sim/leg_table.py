"""The table of parameters that the stepper reads: a row per leg, computed from its robot."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hopping_leg.arrays import Records
from hopping_leg.errors import RobotError
from hopping_leg.robot import GRAVITY, JOINTS, Joint, Robot, model
from hopping_leg.robot.kinematics import Geometry, LegGeometry, Lengths, Radii

SENSORS = ("position", "velocity", "torque")
"""What each joint's sensors measure; columns of readings are (hip, knee) of each in turn."""

_SCALARS = (
    # Masses and inertias, see leg_physics.mass_matrix; inertias with the rotor where it is rigid.
    "mass", "thigh_moment", "shank_moment", "coupling", "hip_inertia", "shank_inertia",
    "knee_inertia", "gravity", "weight", "fixed_base",
    # Boom, if it has a radius: height of its pivot, and mass that moves forward.
    "boom_radius", "boom_pivot", "forward_mass",
    # Geometry.
    "thigh_length", "shank_length", "base_radius", "knee_radius", "foot_radius",
    # Ground and stops: MuJoCo's stiffness and damping, and regularisation per 1 - impedance.
    "ground_friction", "contact_stiffness", "contact_damping", "base_softness", "shank_softness",
    "stop_stiffness", "stop_damping",
    # Rail and dry friction.
    "rail_damping", "rail_friction", "rail_friction_stiffness", "friction_damping",
    # Time between computer and leg, s.
    "command_latency", "command_jitter", "measurement_latency",
)  # fmt: skip

_OF_JOINTS = (
    "stop_lower", "stop_upper", "joint_softness",
    # Friction, at the rotor where that is elastic.
    "damping", "friction", "friction_stiffness", "load_friction", "stiction", "stiction_speed",
    # Motor and gear.
    "torque_limit", "saturation", "stall_torque", "speed_slope", "gain", "follow", "ripple",
    "ripple_periods", "log_efficiency",
    # Transmission.
    "elastic", "armature", "belt_stiffness", "belt_damping", "half_backlash",
)  # fmt: skip

LEG = np.dtype(
    [(name, np.float64) for name in _SCALARS]
    + [(name, np.float64, (2,)) for name in _OF_JOINTS]
    + [(name, np.float64, (6,)) for name in ("sensor_noise", "sensor_step")]
)
"""A row: everything of a leg that the physics needs at a given step."""

_LEAST_FRICTION = 1e-5  # MuJoCo's mjMINMU


def leg_table(robots: Sequence[Robot], timestep: float, *, fixed_base: bool = False) -> Records:
    """Return the rows of robots for a physics step, s; (n,) of ``LEG``.

    A robot's ``reality`` holds. A ``fixed_base`` stays where it is and nothing touches the ground.
    RobotError says that a transmission is too stiff for the step, or has backlash but no stiffness.
    """
    distinct = {id(robot): robot for robot in robots}  # many times the same one
    rows = {key: _row(robot, timestep, fixed_base) for key, robot in distinct.items()}
    return np.array([rows[id(robot)] for robot in robots])


def leg_geometry(robots: Sequence[Robot]) -> Geometry:
    """Return the lengths of robots: the first itself where all are as long."""

    def lengths(robot: Robot) -> tuple[float, ...]:
        balls = (robot.foot, robot.knee_cap, robot.base)
        return (robot.thigh.length, robot.shank.length, *(ball.radius for ball in balls))

    if len({lengths(robot) for robot in robots}) <= 1:
        return robots[0]
    thigh, shank, *balls = np.array([lengths(robot) for robot in robots]).T
    return LegGeometry(Lengths(thigh), Lengths(shank), *map(Radii, balls))


def _row(robot: Robot, timestep: float, fixed_base: bool) -> Records:
    row = np.zeros((), LEG)
    reality = robot.reality
    row["fixed_base"], row["gravity"] = fixed_base, GRAVITY
    for joint in JOINTS:
        _check_transmission(robot, joint, timestep)
    row["elastic"] = ~np.isnan(reality.of_drives("stiffness"))
    guide = robot.boom if robot.boom.radius else robot.rail
    row["rail_damping"], row["rail_friction"] = guide.damping, guide.friction
    for name in ("damping", "friction", "load_friction", "armature", "stop_lower", "stop_upper"):
        row[name] = robot.of_joints(name)
    row["friction"][0] += robot.boom.hip_friction * (robot.boom.radius > 0)
    row["stiction"] = row["friction"] * (reality.of_drives("stiction") - 1)
    row["stiction_speed"] = reality.of_drives("stiction_speed")
    row["belt_damping"] = reality.of_drives("stiffness_damping")
    _set_bodies(row, robot)
    _set_ground(row, robot, timestep)
    _set_drives(row, robot, timestep)
    _set_softness(row, robot, timestep)
    latency = reality.latency
    row["command_latency"], row["command_jitter"] = latency.command, latency.jitter
    row["measurement_latency"] = latency.measurement
    for what in ("noise", "step"):
        row[f"sensor_{what}"] = np.concatenate(
            [reality.of_sensors(f"{sensor}_{what}") for sensor in SENSORS]
        )
    return row


def _set_bodies(row: Records, robot: Robot) -> None:
    scale = robot.reality.mass
    thigh, shank = robot.thigh, robot.shank
    thigh_mass, shank_mass = thigh.mass * scale.thigh, shank.mass * scale.shank
    rigid = np.where(row["elastic"] > 0, 0.0, row["armature"])
    boom = None if row["fixed_base"] or not robot.boom.radius else robot.boom
    base = robot.base.mass - (boom.slider if boom else 0.0)
    row["mass"] = base * scale.base + thigh_mass + shank_mass
    row["weight"] = row["gravity"] * row["mass"]
    if boom:
        row["forward_mass"] = row["mass"] + boom.inertia + boom.forward_mass
        row["mass"] += boom.inertia + boom.mass
        row["weight"] += GRAVITY * boom.moment + boom.weight
        row["boom_radius"], row["boom_pivot"] = boom.radius, boom.pivot
    row["thigh_moment"] = thigh_mass * thigh.com + shank_mass * thigh.length
    row["shank_moment"] = shank_mass * shank.com
    row["coupling"] = row["shank_moment"] * thigh.length
    row["shank_inertia"] = shank.inertia * scale.shank + shank_mass * shank.com**2
    row["hip_inertia"] = (
        thigh.inertia * scale.thigh
        + thigh_mass * thigh.com**2
        + shank_mass * thigh.length**2
        + row["shank_inertia"]
        + rigid[0]
    )
    row["knee_inertia"] = row["shank_inertia"] + rigid[1]
    row["thigh_length"], row["shank_length"] = thigh.length, shank.length
    row["base_radius"], row["knee_radius"] = robot.base.radius, robot.knee_cap.radius
    row["foot_radius"] = robot.foot.radius


def _set_ground(row: Records, robot: Robot, timestep: float) -> None:
    stated = {k: v for k, v in vars(robot.reality.ground).items() if v is not None}
    true = replace(robot.contact, **stated)
    row["ground_friction"] = max(true.friction, _LEAST_FRICTION)
    row["contact_stiffness"], row["contact_damping"] = _spring(
        true.time_constant, true.damping_ratio, timestep
    )
    row["stop_stiffness"], row["stop_damping"] = _spring(model.STOP_TIME_CONSTANT, 1.0, timestep)


def _spring(
    time: float, ratio: float, timestep: float, impedance: float = model.STOP_IMPEDANCE[1]
) -> tuple[float, float]:
    """Return stiffness and damping of MuJoCo's ``solref``, which no step may outrun."""
    time = max(time, 2 * timestep)
    return 1 / (impedance * time * ratio) ** 2, 2 / (impedance * time)


def _set_softness(row: Records, robot: Robot, timestep: float) -> None:
    """Set MuJoCo's ``invweight0``: inverse inertias of the hanging leg, which scale constraints."""
    both = row["shank_inertia"] + row["coupling"]
    mass = np.array(
        [
            [row["mass"], 0, 0],
            [0, row["hip_inertia"] + 2 * row["coupling"], both],
            [0, both, row["knee_inertia"]],
        ]
    )
    inverse = np.linalg.inv(mass)
    if row["fixed_base"]:
        inverse[0, 0] = 0.0
    # Upwards the hanging shank's centre of mass moves with the base, forward with both joints.
    forward = np.array([0.0, robot.thigh.length + robot.shank.com, robot.shank.com])
    if row["boom_radius"]:
        tie = np.array([0.0, row["thigh_moment"] + row["shank_moment"], row["shank_moment"]])
        whole = np.block([[mass, tie[:, None]], [tie, row["forward_mass"]]])
        inverse = np.linalg.inv(whole)
        forward = np.append(forward, 1.0)
    row["base_softness"] = (inverse[0, 0] + (inverse[3, 3] if row["boom_radius"] else 0)) / 3
    row["shank_softness"] = (inverse[0, 0] + forward @ inverse @ forward) / 3
    joints = inverse.diagonal()[1:3]
    row["joint_softness"] = joints
    rotors = np.where(row["elastic"] > 0, 1 / np.maximum(row["armature"], 1e-12), joints)
    impedance = model.FRICTION_IMPEDANCE[0]
    hold = impedance / (1 - impedance)
    row["friction_stiffness"] = hold / rotors
    row["rail_friction_stiffness"] = hold / inverse[0, 0] if inverse[0, 0] else 1.0
    _, row["friction_damping"] = _spring(model.FRICTION_TIME_CONSTANT, 1.0, timestep, impedance)


def _set_drives(row: Records, robot: Robot, timestep: float) -> None:
    """Set limits and losses of both drives, at the joints; a lower voltage moves the whole line."""
    reality = robot.reality
    for at, (name, drive) in enumerate(zip(JOINTS, (reality.hip, reality.knee), strict=True)):
        joint: Joint = getattr(robot, name)
        stall = joint.motor.peak_torque * joint.belt_ratio
        row["torque_limit"][at] = joint.torque_limit
        row["stall_torque"][at] = stall * reality.voltage
        row["speed_slope"][at] = stall / joint.no_load_speed
        row["saturation"][at] = stall if drive.torque_limit is None else drive.torque_limit
        row["gain"][at] = joint.torque_gain * drive.torque_gain
        row["follow"][at] = -np.expm1(-timestep / drive.torque_lag) if drive.torque_lag else 1.0
        row["ripple"][at], row["ripple_periods"][at] = drive.ripple, drive.ripple_periods
        row["log_efficiency"][at] = np.log(drive.efficiency)
        row["belt_stiffness"][at] = drive.stiffness or 0.0
        row["half_backlash"][at] = drive.backlash / 2


def stiffest(robot: Robot, joint: str, timestep: float) -> float:
    """Return the stiffest transmission of a joint that a physics step can simulate, N m/rad.

    Rotor and link against the spring oscillate at w; semi-implicit Euler needs w dt < 2.
    """
    link, axis = (robot.thigh, robot.hip) if joint == "hip" else (robot.shank, robot.knee)
    return 1 / (1 / axis.armature + 1 / (link.inertia + link.mass * link.com**2)) / timestep**2


def _check_transmission(robot: Robot, joint: str, timestep: float) -> None:
    drive, most = getattr(robot.reality, joint), stiffest(robot, joint, timestep)
    if drive.backlash and drive.stiffness is None:
        raise RobotError(
            f"{robot.name}: 'reality.{joint}' has a backlash of {drive.backlash:g} rad but no"
            " 'stiffness', N m/rad; give the stiffness of gear and belt beyond it."
        )
    if drive.stiffness is not None and drive.stiffness > most:
        raise RobotError(
            f"{robot.name}: 'reality.{joint}.stiffness' is {drive.stiffness:g} N m/rad, too stiff"
            f" for a physics step of {timestep:g} s; give at most {most:.3g}, a smaller step, or"
            " leave it out for a rigid one."
        )
