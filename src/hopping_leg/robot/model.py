"""The leg as a MuJoCo model and as URDF: geometry from a file, physics from parameters."""

from importlib import resources
from xml.sax.saxutils import quoteattr

import mujoco
import numpy as np

from hopping_leg.errors import RobotError
from hopping_leg.robot.parameters import Joint, Link, Rail, Robot

# Warnings would be logged to a file in the user's folder.
_LOGGING = mujoco.MjLogConfig.get()
_LOGGING.logto_file = False
_LOGGING.set()

GRAVITY = 9.81  # Standard gravity, m/s2; leg.xml states the same
CONTROL_RATE = 200.0  # That of the paper, Hz

TIMESTEP = 1.25e-4
"""Physics step of environment and evaluation, s, see ``python -m studies.physics_step``."""

COARSE_TIMESTEP = 5e-4
"""Physics step of identification, whose errors are below those of recordings, s."""

STOP_TIME_CONSTANT = 0.005
"""Time constant with which a mechanical stop pushes a joint back, critically damped, s."""

STOP_IMPEDANCE = (0.9, 0.95, 0.001, 0.5, 2.0)
"""MuJoCo's default ``solimp``, that of the stops."""

FRICTION_TIME_CONSTANT = 0.001
"""Time constant with which dry friction takes a joint's speed, s."""

FRICTION_IMPEDANCE = (0.999, 0.999, 0.001, 0.5, 2.0)
"""``solimp`` of dry friction that holds: by MuJoCo's default a joint creeps at 10 mrad/s."""

_THIN = 1e-9  # Inertia around the axes a planar link cannot turn about only has to be valid


def get_spec(
    robot: Robot, timestep: float = TIMESTEP, *, fixed_base: bool = False
) -> mujoco.MjSpec:
    """Build the editable model of a robot for a physics step, s.

    A fixed base has no rail joint and the floor touches nothing.
    Controls are motor torques at the gear's output, N m: the belt is the actuator's gear, so the
    joint sees ``belt_ratio`` times the control and the motor's reflected inertia.
    """
    xml = (resources.files("hopping_leg.robot") / "leg.xml").read_text(encoding="utf-8")
    spec = mujoco.MjSpec.from_string(xml)
    spec.option.timestep = timestep
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE  # 4.0.0 factorises sparse ones wrongly
    _set_inertia(spec.body("base"), robot.base.mass, 0.0, _THIN)
    spec.geom("base").size[0] = robot.base.radius
    _set_friction(spec.joint("rail"), robot.rail)
    _set_link(spec, "thigh", robot.thigh, robot.hip)
    _set_link(spec, "shank", robot.shank, robot.knee)
    spec.body("shank").pos = [0, 0, -robot.thigh.length]
    spec.geom("knee_cap").size[0] = robot.knee_cap.radius
    spec.geom("foot").size[0] = robot.foot.radius
    spec.geom("foot").pos = spec.site("foot").pos = [0, 0, -robot.shank.length]
    floor = spec.geom("floor")
    floor.priority = 1
    floor.solref = [robot.contact.time_constant, robot.contact.damping_ratio]
    floor.friction[0] = robot.contact.friction
    floor.contype, floor.conaffinity = 0 if fixed_base else 1, 0
    for name, joint in (("hip", robot.hip), ("knee", robot.knee)):
        limit = joint.motor.torque_limit
        actuator = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        actuator.set_to_motor()
        actuator.gear[0] = joint.belt_ratio
        actuator.ctrlrange = [-limit, limit]
    if fixed_base:
        spec.delete(spec.joint("rail"))
    return spec


def build_model(robot: Robot, timestep: float = TIMESTEP) -> mujoco.MjModel:
    """Compile a robot's model over (rail height, hip, knee), or raise RobotError."""
    try:
        return get_spec(robot, timestep).compile()
    except ValueError as error:
        reason = " ".join(str(error).split()).removeprefix("Error: ")
        raise RobotError(f"MuJoCo cannot build robot '{robot.name}': {reason}.") from error


def _set_link(spec: mujoco.MjSpec, name: str, link: Link, joint: Joint) -> None:
    _set_inertia(spec.body(name), link.mass, -link.com, link.inertia)
    spec.geom(name).fromto = [0, 0, 0, 0, 0, -link.length]
    axis = spec.joint("hip" if name == "thigh" else "knee")
    _set_friction(axis, joint)
    axis.armature = joint.armature
    axis.range = [joint.stop_lower, joint.stop_upper]
    axis.solref_limit = [STOP_TIME_CONSTANT, 1.0]
    axis.solimp_limit = STOP_IMPEDANCE


def _set_friction(axis: mujoco.MjsJoint, parameters: Rail | Joint) -> None:
    """Set dry friction and linear damping; the latter's other entries are higher terms."""
    axis.frictionloss = parameters.friction
    axis.solref_friction = [FRICTION_TIME_CONSTANT, 1.0]
    axis.solimp_friction = FRICTION_IMPEDANCE
    axis.damping = np.array([parameters.damping, 0.0, 0.0])


def _set_inertia(body: mujoco.MjsBody, mass: float, com_z: float, inertia: float) -> None:
    body.explicitinertial = True
    body.mass = mass
    body.ipos = [0, 0, com_z]
    body.inertia = [inertia, inertia, min(inertia, _THIN)]


def to_urdf(robot: Robot) -> str:
    """Return the leg as URDF: rail (passive), hip, knee, and a fixed frame ``foot``.

    The world's z is up, positive angles swing the foot to +x, zero is the straight leg downwards.
    URDF knows neither a motor's reflected inertia, which stands in a comment at each joint, nor its
    torque-speed limit: a joint's ``velocity`` is the speed at which its motor has no torque left.
    Its ``limit`` are the mechanical stops. All is at the joint's side of the belt.
    """
    text = (resources.files("hopping_leg.robot") / "leg.urdf").read_text(encoding="utf-8")
    half = {f"half_{name}": getattr(robot, name).length / 2 for name in ("thigh", "shank")}
    return text.format(robot=robot, name=quoteattr(robot.name), **half)
