"""One leg in one PyBullet world.

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

from hopping_leg.arrays import Array
from hopping_leg.errors import RobotError, UsageError
from hopping_leg.robot import GRAVITY, Robot, to_urdf

ROTOR = "knee_rotor"
"""Name of the rotor's link and joint."""

_ROTOR_MASS = 1e-3
"""Any small share of the base's, kg: PyBullet takes a massless link for a fixed one."""

_ITERATIONS = 50
"""Iterations of the constraint solver, which never stops earlier: the same bytes every time."""

_NO_LIMIT = 1e6
"""In place of PyBullet's own limits of speed and force."""

Spring = tuple[float, float]
"""Stiffness, N/m, and damping, N s/m, of the ground."""


class PyBulletWorld:
    """A leg, its ground and nothing else; coordinates are (rail height, hip, knee).

    Coulomb friction is a motor that holds the joint's speed at zero with that much torque at most;
    viscous damping is the URDF's. PyBullet's own damping of bodies (0.04 of their speed per
    second) and its limit of joint speeds (100 rad/s) are off. Without a ``spring`` the ground is
    rigid; a foot that does not collide gets its contact as a push.
    """

    def __init__(
        self,
        robot: Robot,
        timestep: float,
        *,
        spring: Spring | None = None,
        foot_collides: bool = True,
    ) -> None:
        self._bullet = bullet = import_pybullet()
        self._id = bullet.connect(bullet.DIRECT)
        self._world = {"physicsClientId": self._id}
        if self._id < 0:
            raise UsageError(
                "PyBullet has no world left for another leg; simulate fewer at once, or leave"
                " --engine out."
            )
        bullet.setGravity(0, 0, -GRAVITY, **self._world)
        solver = {"numSolverIterations": _ITERATIONS, "solverResidualThreshold": 0}
        bullet.setPhysicsEngineParameter(fixedTimeStep=timestep, **solver, **self._world)
        self._leg = self._load(pybullet_urdf(robot, foot_collides=foot_collides))
        self._joints = self._find_joints()
        self._make_free(robot)
        self._add_ground(robot, spring)

    def _load(self, urdf: str) -> int:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "leg.urdf"
            path.write_text(urdf, encoding="utf-8")
            leg: int = self._bullet.loadURDF(
                str(path),
                useFixedBase=True,
                flags=self._bullet.URDF_USE_INERTIA_FROM_FILE,
                **self._world,
            )
        return leg

    def _find_joints(self) -> dict[str, int]:
        count = self._bullet.getNumJoints(self._leg, **self._world)
        infos = [
            self._bullet.getJointInfo(self._leg, joint, **self._world) for joint in range(count)
        ]
        return {info[1].decode(): info[0] for info in infos}

    def _make_free(self, robot: Robot) -> None:
        bullet, leg, joints, world = self._bullet, self._leg, self._joints, self._world
        free = {"linearDamping": 0, "angularDamping": 0, "maxJointVelocity": _NO_LIMIT}
        friction = {name: getattr(robot, name).friction for name in ("rail", "hip", "knee")}
        hold = bullet.VELOCITY_CONTROL
        for name, joint in joints.items():
            force = friction.get(name, 0.0)
            bullet.changeDynamics(leg, joint, **free, lateralFriction=1, **world)
            bullet.setJointMotorControl2(leg, joint, hold, targetVelocity=0, force=force, **world)
        knee, rotor, gear = joints["knee"], joints[ROTOR], bullet.JOINT_GEAR
        here = [0, 0, 0]
        gear = bullet.createConstraint(leg, knee, leg, rotor, gear, [0, -1, 0], here, here, **world)
        bullet.changeConstraint(gear, gearRatio=-1, maxForce=_NO_LIMIT, **world)
        self._coordinates = [joints[name] for name in ("rail", "hip", "knee")]
        self._motors = [joints["hip"], joints["knee"]]

    def _add_ground(self, robot: Robot, spring: Spring | None) -> None:
        bullet = self._bullet
        shape = bullet.createCollisionShape(bullet.GEOM_PLANE, **self._world)
        ground = bullet.createMultiBody(0, shape, **self._world)
        surface: dict[str, float] = {"lateralFriction": robot.contact.friction}
        if spring is not None:
            surface |= {"contactStiffness": spring[0], "contactDamping": spring[1]}
        bullet.changeDynamics(ground, -1, **surface, **self._world)

    def put(self, state: Array) -> None:
        """Give the leg a state (x, q1, q2 and their rates), (6,)."""
        places = [*self._coordinates, self._joints[ROTOR]]
        for joint, source in zip(places, (0, 1, 2, 2), strict=True):
            self._bullet.resetJointState(
                self._leg, joint, float(state[source]), float(state[source + 3]), **self._world
            )

    def step(self, torque: Array, substeps: int) -> Array:
        """Hold joint torques, N m, (2,), for some steps; return the state then, (6,)."""
        bullet, forces = self._bullet, torque.tolist()
        for _ in range(substeps):
            bullet.setJointMotorControlArray(
                self._leg, self._motors, bullet.TORQUE_CONTROL, forces=forces, **self._world
            )
            bullet.stepSimulation(**self._world)
        joints = bullet.getJointStates(self._leg, self._coordinates, **self._world)
        return np.array([joint[0] for joint in joints] + [joint[1] for joint in joints])

    def push(self, force: Array, place: Array) -> None:
        """Push the shank during the next step by an upward and forward force, N, (2,).

        ``place`` is the height above the ground and the forward offset from the hip, m, (2,).
        """
        self._bullet.applyExternalForce(
            self._leg,
            self._joints["knee"],
            [float(force[1]), 0.0, float(force[0])],
            [float(place[1]), 0.0, float(place[0])],
            self._bullet.WORLD_FRAME,
            **self._world,
        )

    def close(self) -> None:
        """Free the world; PyBullet has room for about a thousand."""
        if self._id >= 0:
            self._bullet.disconnect(self._id)
            self._id = -1


def import_pybullet() -> Any:  # noqa: ANN401
    """Import PyBullet where it is asked for.

    Raises:
        UsageError: It is not installed.
    """
    try:
        import pybullet
    except ModuleNotFoundError as error:
        raise UsageError(
            "This engine needs PyBullet; install it with `pip install 'hopping-leg[bullet]'`."
        ) from error
    return pybullet


def pybullet_urdf(robot: Robot, *, foot_collides: bool = True) -> str:
    """Return the URDF to be loaded with ``URDF_USE_INERTIA_FROM_FILE``.

    The fixed frame ``foot`` is left out, which nothing here asks for, and the rail is long. Knee
    and base collide in any case.

    Raises:
        RobotError: The base is too light to give the rotor its mass.
    """
    if robot.base.mass <= _ROTOR_MASS:
        raise RobotError(
            f"The base of {robot.name} weighs {robot.base.mass:g} kg but must weigh more than"
            f" {_ROTOR_MASS:g} kg in PyBullet; leave --engine out."
        )
    base = dataclasses.replace(robot.base, mass=robot.base.mass - _ROTOR_MASS)
    inertia = robot.thigh.inertia + robot.hip.armature
    thigh = dataclasses.replace(robot.thigh, inertia=inertia)
    root = Xml.fromstring(to_urdf(dataclasses.replace(robot, base=base, thigh=thigh)))
    for element in [e for e in root if e.get("name") in ("foot", "foot_tip")]:
        root.remove(element)
    for limit in root.iterfind("joint[@name='rail']/limit"):
        limit.attrib.update(lower="-1000", upper="1000")
    if not foot_collides:
        for shank in root.iterfind("link[@name='shank']"):
            shank.remove(shank.findall("collision")[-1])
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
