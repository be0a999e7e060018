"""The leg as ``[reality]`` has it, for MuJoCo: true masses and ground, backlash and belts.

Backlash is a second hinge on the joint's axis that moves freely within its limits; a belt is one
with a spring. Motor, armature, friction and encoder stay at the first hinge, the link hangs on the
second, so that the link's angle is the sum. MuJoCo's limits and springs keep this stable at the
step at which training runs. Where a belt has backlash, too, one hinge does for both: its spring,
with a dead band, is a torque from ``sim.mismatch_simulator``, as between two hinges nothing had
inertia.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from operator import attrgetter

import mujoco
import numpy as np
from mujoco import batch

from hopping_leg.arrays import Array, IntArray
from hopping_leg.errors import RobotError
from hopping_leg.robot import Contact, DriveMismatch, Joint, Link, Robot, compile_spec, get_spec

_HARD = (0.99, 0.999, 1e-4, 0.5, 2.0)
"""``solimp`` of hard limits and of friction that holds."""

_AXIS = (0.0, -1.0, 0.0)
_BODIES = {"hip": "thigh", "knee": "shank"}


@dataclass(frozen=True)
class MismatchModel:
    """A compiled model and where the leg's coordinates are in it.

    Attributes:
        model: Generalised coordinates are the rail, unless clamped, and per joint motor, backlash,
            belt.
        motor: Coordinate of each joint's motor, (2,).
        flexible: Coordinate between motor and link, per joint; None where rigid.
    """

    model: mujoco.MjModel
    motor: IntArray
    flexible: tuple[int | None, int | None]


def mismatch_model(robot: Robot, timestep: float, *, clamped: bool) -> MismatchModel:
    """Build the model of a leg as its ``reality`` says, for a physics step, s.

    A ``clamped`` base is fixed: it has no rail and touches nothing.

    Raises:
        RobotError: A belt is too stiff for the physics step, or MuJoCo refuses a number.
    """
    spec = get_spec(true_parameters(robot), timestep)
    if clamped:
        spec.delete(spec.joint("rail"))
        spec.geom("floor").contype = 0
    for name, body in _BODIES.items():
        joint, link = getattr(robot, name), getattr(robot, body)
        drive = getattr(robot.reality, name)
        _harden_friction(spec, name, drive, timestep)
        _add_transmission(spec, name, drive, timestep)
        _check_stiffness(robot, name, joint, link, timestep)
    for actuator in spec.actuators:
        actuator.ctrllimited = False  # gains and ripple come after the software's limit
    model = compile_spec(spec, robot.name)
    motor = np.array([model.joint(name).qposadr[0] for name in _BODIES])
    names = [model.joint(number).name for number in range(model.njnt)]
    hip, knee = (
        int(model.joint(between).qposadr[0]) if between in names else None
        for between in map(_between, _BODIES)
    )
    return MismatchModel(model, motor, (hip, knee))


def true_parameters(robot: Robot) -> Robot:
    """Return the leg with true masses, ground and motor limits in place of the believed ones."""
    reality = robot.reality
    scale, ground, believed = reality.mass, reality.ground, robot.contact
    contact = Contact(
        believed.time_constant if ground.time_constant is None else ground.time_constant,
        believed.damping_ratio if ground.damping_ratio is None else ground.damping_ratio,
        believed.friction if ground.friction is None else ground.friction,
    )
    return replace(
        robot,
        base=replace(robot.base, mass=robot.base.mass * scale.base),
        thigh=_scaled(robot.thigh, scale.thigh),
        shank=_scaled(robot.shank, scale.shank),
        contact=contact,
        hip=_limited(robot.hip, reality.hip, reality.voltage),
        knee=_limited(robot.knee, reality.knee, reality.voltage),
    )


def _scaled(link: Link, scale: float) -> Link:
    return replace(link, mass=link.mass * scale, inertia=link.inertia * scale)


def _limited(joint: Joint, drive: DriveMismatch, voltage: float) -> Joint:
    """A lower voltage moves the whole torque-speed line down; its slope is the winding's."""
    motor = joint.motor
    limit = motor.torque_limit
    if drive.torque_limit is not None:
        limit = min(limit, drive.torque_limit / joint.belt_ratio)
    line = {
        "peak_torque": motor.peak_torque * voltage,
        "no_load_speed": motor.no_load_speed * voltage,
    }
    return replace(joint, motor=replace(motor, torque_limit=limit, **line))


def _between(joint: str) -> str:
    return f"{joint}_transmission"


def _harden_friction(spec: mujoco.MjSpec, name: str, drive: DriveMismatch, timestep: float) -> None:
    """Let friction hold: by default MuJoCo's creeps faster than where Stribeck's curve falls."""
    if drive.stiction > 1:
        joint = spec.joint(name)
        joint.solref_friction = [2 * timestep, 1.0]
        joint.solimp_friction = _HARD


def _add_transmission(
    spec: mujoco.MjSpec, name: str, drive: DriveMismatch, timestep: float
) -> None:
    if not drive.backlash and drive.stiffness is None:
        return
    hinge = spec.body(_BODIES[name]).add_joint(
        name=_between(name), type=mujoco.mjtJoint.mjJNT_HINGE, axis=_AXIS
    )
    hinge.damping = np.array([drive.stiffness_damping, 0.0, 0.0])
    if drive.stiffness is None:
        hinge.limited = True
        hinge.range = [-drive.backlash / 2, drive.backlash / 2]
        hinge.solref_limit = [2 * timestep, 1.0]
        hinge.solimp_limit = _HARD
    elif not drive.backlash:
        hinge.stiffness = np.array([drive.stiffness, 0.0, 0.0])


def _check_stiffness(robot: Robot, name: str, joint: Joint, link: Link, timestep: float) -> None:
    """Motor and link against the spring oscillate at w; semi-implicit Euler needs w dt < 2."""
    stiffness = getattr(robot.reality, name).stiffness
    if stiffness is None:
        return
    about_joint = link.inertia + link.mass * link.com**2
    reduced = 1 / (1 / joint.armature + 1 / about_joint)
    highest = reduced / timestep**2
    if stiffness > highest:
        raise RobotError(
            f"{robot.name}: 'reality.{name}.stiffness' is {stiffness:g} N m/rad, too stiff for"
            f" a physics step of {timestep:g} s; give at most {highest:.3g}, a smaller step"
            f" (below {math.sqrt(reduced / stiffness):.2g} s), or leave it out for a rigid belt."
        )


def set_model_fields(simulation: batch.Batch, models: Sequence[mujoco.MjModel]) -> None:
    """Give every simulation the numbers of its model, in its present state.

    The models, one per simulation, differ in floating point alone. Their numbers become per-
    simulation fields, which go on holding what is not written again: unlike whole models, single
    ones of them may then change from step to step (``JointFriction``).
    """
    shared = simulation.model
    for name in _numbers(shared):
        number = attrgetter(name)
        own = np.stack([number(model) for model in models])
        if simulation.expanded(name) is not None or (own != number(shared)).any():
            simulation.expand(name)[:] = own


def _numbers(model: mujoco.MjModel) -> list[str]:
    """Return the names of all that is floating point and not empty, in alphabetical order."""
    found = []
    for name in sorted(batch.MODEL_FIELDS):
        value = attrgetter(name)(model)
        if isinstance(value, np.ndarray) and value.dtype.kind == "f" and value.size:
            found.append(name)
    return found


class JointFriction:
    """Sets MuJoCo's friction loss, whose solver holds a joint at rest.

    ``joints`` are the degrees of freedom of hip and knee, (2,).
    """

    def __init__(self, robots: Sequence[Robot], simulation: batch.Batch, joints: IntArray) -> None:
        self._coulomb, self._load = (
            np.array([robot.of_joints(name) for robot in robots])
            for name in ("friction", "load_friction")
        )
        self._joints, self._loss = joints, simulation.expand("dof_frictionloss")

    def set(self, torque: Array, further: Array | float = 0.0) -> None:
        """Set the friction at the motors' torque, and ``further`` friction, N m, (n, 2)."""
        self._loss[:, self._joints] = self._coulomb + self._load * np.abs(torque) + further


def friction_grows_with_load(robots: Sequence[Robot]) -> bool:
    """Tell whether any leg's friction grows with load."""
    return any(robot.of_joints("load_friction").any() for robot in robots)
