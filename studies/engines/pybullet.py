"""Legs in PyBullet, another engine: does a controller lean on what only MuJoCo's physics does?

URDF knows no reflected inertia (armature) and PyBullet has no other place for it, so it becomes
inertia that turns as the armature does:

- The base does not turn, so the thigh turns with the hip's angle: the hip's armature adds to the
  thigh's inertia, exactly.
- The shank turns with hip and knee. A rotor on the base, geared to the knee's angle alone, carries
  the knee's armature; its mass, on the hip's axis, is taken from the base.

Both together give the closed form's mass matrix, in the air and against the ground.
"""

import dataclasses
import tempfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as Xml

import numpy as np

from hopping_leg.arrays import Array, IntArray
from hopping_leg.errors import UsageError
from hopping_leg.robot import GRAVITY, TIMESTEP, MotorLimit, Robot, to_urdf
from hopping_leg.sim.simulator import CONTROL_RATE, Simulator

ROTOR = "knee_rotor"
"""Name of the rotor's link and joint."""

_ROTOR_MASS = 1e-3
"""Any small share of the base's, kg: PyBullet takes a massless link for a fixed one."""

_ITERATIONS = 50
"""Iterations of the constraint solver, which never stops earlier: the same bytes every time."""

_NO_LIMIT = 1e6
"""In place of PyBullet's own limits of speed and force."""


class PyBulletWorld:
    """A leg, its ground and nothing else; coordinates are (rail height, hip, knee).

    Coulomb friction is a motor that holds the joint's speed at zero with that much torque at most;
    viscous damping is the URDF's. PyBullet's own damping of bodies (0.04 of their speed per
    second) and its limit of joint speeds (100 rad/s) are off.
    """

    def __init__(self, robot: Robot, timestep: float) -> None:
        self._bullet = bullet = open_bullet()
        bullet.setGravity(0, 0, -GRAVITY)
        solver = {"numSolverIterations": _ITERATIONS, "solverResidualThreshold": 0}
        bullet.setPhysicsEngineParameter(fixedTimeStep=timestep, **solver)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "leg.urdf"
            path.write_text(pybullet_urdf(robot), encoding="utf-8")
            flags = bullet.URDF_USE_INERTIA_FROM_FILE
            self._leg = leg = bullet.loadURDF(str(path), useFixedBase=True, flags=flags)
        infos = (bullet.getJointInfo(leg, joint) for joint in range(bullet.getNumJoints(leg)))
        self._joints = joints = {info[1].decode(): info[0] for info in infos}
        self._coordinates = [joints[name] for name in ("rail", "hip", "knee")]
        self._motors = [joints["hip"], joints["knee"]]
        self._make_free(robot)
        ground = bullet.createMultiBody(0, bullet.createCollisionShape(bullet.GEOM_PLANE))
        bullet.changeDynamics(ground, -1, lateralFriction=robot.contact.friction)

    def _make_free(self, robot: Robot) -> None:
        bullet, leg, joints = self._bullet, self._leg, self._joints
        free = {"linearDamping": 0, "angularDamping": 0, "maxJointVelocity": _NO_LIMIT}
        friction = {name: getattr(robot, name).friction for name in ("rail", "hip", "knee")}
        hold = bullet.VELOCITY_CONTROL
        for name, joint in joints.items():
            force = friction.get(name, 0.0)
            bullet.changeDynamics(leg, joint, **free, lateralFriction=1)
            bullet.setJointMotorControl2(leg, joint, hold, targetVelocity=0, force=force)
        knee, rotor, here = joints["knee"], joints[ROTOR], [0, 0, 0]
        gear = bullet.createConstraint(
            leg, knee, leg, rotor, bullet.JOINT_GEAR, [0, -1, 0], here, here
        )
        bullet.changeConstraint(gear, gearRatio=-1, maxForce=_NO_LIMIT)

    def put(self, state: Array) -> None:
        """Give the leg a state (x, q1, q2 and their rates), (6,)."""
        places = [*self._coordinates, self._joints[ROTOR]]
        for joint, source in zip(places, (0, 1, 2, 2), strict=True):
            angle, rate = float(state[source]), float(state[source + 3])
            self._bullet.resetJointState(self._leg, joint, angle, rate)

    def step(self, torque: Array) -> Array:
        """Hold joint torques, N m, (2,), for a step; return the state then, (6,)."""
        bullet, motors = self._bullet, self._motors
        bullet.setJointMotorControlArray(
            self._leg, motors, bullet.TORQUE_CONTROL, forces=torque.tolist()
        )
        bullet.stepSimulation()
        joints = bullet.getJointStates(self._leg, self._coordinates)
        return np.array([joint[0] for joint in joints] + [joint[1] for joint in joints])


def open_bullet() -> Any:  # noqa: ANN401
    """Return a world of PyBullet's own, freed with what holds it; it has room for about a thousand.

    Raises:
        UsageError: PyBullet is not installed, or has no world left.
    """
    try:
        import pybullet
        from pybullet_utils.bullet_client import BulletClient
    except ModuleNotFoundError as error:
        raise UsageError(
            "This study needs PyBullet; install it with `pip install pybullet`."
        ) from error
    client = BulletClient(pybullet.DIRECT)
    if client._client < 0:
        raise UsageError("PyBullet has no world left for another leg; simulate fewer at once.")
    return client


def pybullet_urdf(robot: Robot) -> str:
    """Return the URDF to be loaded with ``URDF_USE_INERTIA_FROM_FILE``.

    The fixed frame ``foot`` is left out, which nothing here asks for, and the rail is long.
    """
    base = dataclasses.replace(robot.base, mass=robot.base.mass - _ROTOR_MASS)
    inertia = robot.thigh.inertia + robot.hip.armature
    thigh = dataclasses.replace(robot.thigh, inertia=inertia)
    root = Xml.fromstring(to_urdf(dataclasses.replace(robot, base=base, thigh=thigh)))
    for element in [e for e in root if e.get("name") in ("foot", "foot_tip")]:
        root.remove(element)
    for limit in root.iterfind("joint[@name='rail']/limit"):
        limit.attrib.update(lower="-1000", upper="1000")
    _add_rotor(root, robot.knee.armature)
    return Xml.tostring(root, encoding="unicode")


def _add_rotor(root: Xml.Element, inertia: float) -> None:
    link = Xml.SubElement(root, "link", name=ROTOR)
    inertial = Xml.SubElement(link, "inertial")
    Xml.SubElement(inertial, "mass", value=repr(_ROTOR_MASS))
    moments = dict.fromkeys(("ixx", "iyy", "izz"), repr(inertia))
    Xml.SubElement(inertial, "inertia", moments, ixy="0", ixz="0", iyz="0")
    joint = Xml.SubElement(root, "joint", name=ROTOR, type="continuous")
    Xml.SubElement(joint, "parent", link="base")
    Xml.SubElement(joint, "child", link=ROTOR)
    Xml.SubElement(joint, "axis", xyz="0 -1 0")


class PyBulletSimulator(Simulator):
    """Legs in PyBullet, each in a world of its own, one after the other, on rigid ground.

    Dynamics, motors' limits, friction and damping are those of ``LegSimulator``, see
    ``pybullet_urdf``; stops are rigid.

    Raises:
        UsageError: PyBullet is not installed, the physics step does not divide the control period,
            or the robot has a ``reality`` or friction that grows with load.
    """

    def __init__(
        self,
        robot: Robot,
        count: int,
        *,
        rate: float = CONTROL_RATE,
        timestep: float = TIMESTEP,
    ) -> None:
        super().__init__(robot, count, rate, timestep)
        friction = "a 'load_friction'" if robot.of_joints("load_friction").any() else ""
        if beyond := friction if robot.reality.neutral else "effects in [reality]":
            raise UsageError(
                f"{robot.name} has {beyond}, which PyBullet does not simulate; take a robot"
                " without, e.g. legv2-paper."
            )
        self._worlds = [PyBulletWorld(robot, timestep) for _ in range(count)]
        self._show(np.zeros((count, 6)))
        self._known = np.full((count, 6), np.nan)
        self._motors = MotorLimit(robot)
        self._applied = np.zeros((count, 2))

    @property
    def measured_torque(self) -> Array:
        """What the motors' torque measurement reports now, N m at the joints, (n, 2)."""
        return self._applied

    def place(self, ids: IntArray | slice, height: Array | float, q: Array) -> None:
        """Put legs at rest at a height, m, and posture, rad."""
        self._applied = np.zeros((self.count, 2))
        self.state[ids] = 0
        self.height[ids] = height
        self.q[ids] = q

    def step(self, torque: Array) -> Array:
        """Command joint torques for a control period; return the motors' mean, N m, (n, 2)."""
        for moved in np.flatnonzero((self.state != self._known).any(axis=1)):
            self._worlds[moved].put(self.state[moved])
        total = np.zeros((self.count, 2))
        for _ in range(self.substeps):
            self._applied = self._motors.give(torque, self.qd)
            for leg, world in enumerate(self._worlds):
                self.state[leg] = world.step(self._applied[leg])
            total += self._applied
        self._known[:] = self.state
        return total / self.substeps
