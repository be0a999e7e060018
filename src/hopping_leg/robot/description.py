"""A URDF or MJCF file as MuJoCo reads it, alone: no mesh and no other file is opened.

Everything stands where the file's zero posture puts it, in the file's world frame, SI units.
"""

import contextlib
import re
import warnings
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree as Xml

import mujoco
import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.errors import RobotError
from hopping_leg.io import one_line

_LARGEST_FILE = 1 << 20  # bytes
_MOST_ELEMENTS = 5000
_FARTHEST = 1e6  # m
_NOTHING = 1e-12
"""Mass and inertia that stand for none, kg and kg m2: MuJoCo moves no body without them."""

_MJCF_PARTS = ("compiler", "option", "default", "worldbody", "actuator")
_MULTIPLYING = ("include", "replicate", "attach", "composite", "flexcomp")
_OF_FILES = (mujoco.mjtGeom.mjGEOM_MESH, mujoco.mjtGeom.mjGEOM_HFIELD, mujoco.mjtGeom.mjGEOM_SDF)
_SPHERE, _CAPSULE = mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_CAPSULE


class Point(NamedTuple):
    """The origin of a frame, or the centre of a sphere."""

    name: str
    position: Array
    """m, (3,)."""
    radius: float
    """Of the sphere, m; 0 for a frame."""


class Description:
    """What a file says; bodies and joints by their numbers in MuJoCo's ``model``.

    Raises:
        RobotError: The file is neither URDF nor MJCF, MuJoCo refuses it, or a body's mass is that
            of a mesh.
    """

    def __init__(self, path: Path) -> None:
        self.origin = str(path)
        root = _parse(path)
        is_urdf = root.tag == "robot"
        self.name = root.get("name" if is_urdf else "model", "").strip() or "leg"
        self.loops = len([*root.findall("equality/*"), *root.iter("mimic")])
        """Constraints that close a loop, which are left out."""
        self._velocities = _prepare_urdf(root) if is_urdf else {}
        if not is_urdf:
            root[:] = [part for part in root if part.tag in _MJCF_PARTS]
        try:
            spec = mujoco.MjSpec.from_string(Xml.tostring(root, encoding="unicode"))
            self._leave_files_out(spec)
            shifts = _make_movable(spec) if is_urdf else {}
            with warnings.catch_warnings(action="ignore"):  # of what is deprecated
                self.model = spec.compile()
        except (ValueError, mujoco.FatalError, RecursionError) as error:
            why = re.sub(r", line \d+", "", one_line(error)).rstrip(".")  # a line of the copy
            raise RobotError(f"{path} is no model that MuJoCo reads: {why}.") from error
        self.data = mujoco.MjData(self.model)
        mujoco.mj_kinematics(self.model, self.data)
        places = (self.data.xipos, self.data.geom_xpos, self.data.xaxis)
        if not all(np.all(np.abs(place) < _FARTHEST) for place in places):
            raise RobotError(f"{path}: its bodies lie farther away than any leg's; check its file.")
        strength = np.linalg.norm(self.model.opt.gravity)
        if not strength > 0:
            raise RobotError(f"{path} has no gravity, which says where down is.")
        self.up = -self.model.opt.gravity / strength
        """Against gravity, unit vector, (3,)."""
        added = [shifts.get(self.body(i), 0.0) for i in range(self.model.nbody)]
        self.inertia = self.model.body_inertia - np.array(added)[:, None]
        """Principal moments of the bodies, in the axes ``data.ximat``, kg m2, (bodies, 3)."""

    def _leave_files_out(self, spec: mujoco.MjSpec) -> None:
        for part in (*spec.geoms, *spec.sites):
            part.material = ""
        for geom in list(spec.geoms):
            if geom.type in _OF_FILES or geom.meshname:
                body, weighs = geom.parent, geom.mass > 0 or (geom.mass != 0 and geom.density > 0)
                if weighs and not body.explicitinertial and body.name != "world":
                    raise RobotError(
                        f"{self.origin}: body '{body.name}' weighs what its mesh '{geom.meshname}'"
                        " weighs, and meshes are not read; give the body an <inertial>."
                    )
                spec.delete(geom)
        for actuator in list(spec.actuators):
            if actuator.trntype != mujoco.mjtTrn.mjTRN_JOINT:
                spec.delete(actuator)

    def joint(self, number: int) -> str:
        """Return a joint's name."""
        return self.model.joint(number).name or f"unnamed {number}"

    def body(self, number: int) -> str:
        """Return a body's name."""
        return self.model.body(number).name or f"unnamed {number}"

    def heavy(self, bodies: Iterable[int]) -> list[int]:
        """Return those bodies that have a mass, in the file's order."""
        return sorted(i for i in bodies if self.model.body_mass[i] > 2 * _NOTHING)

    def subtree(self, top: int) -> set[int]:
        """Return a body and all that hang on it."""
        found = {int(top)}
        for i in range(top + 1, self.model.nbody):
            found |= {i} if self.model.body_parentid[i] in found else set()
        return found

    def above(self, joint: int, kind: mujoco.mjtJoint) -> Iterator[int]:
        """Yield the joints of a kind between a joint and the world, the nearest first."""
        dof = self.model.jnt_dofadr[joint]
        while (dof := self.model.dof_parentid[dof]) >= 0:
            above = int(self.model.dof_jntid[dof])
            if self.model.jnt_type[above] == kind:
                yield above

    def zero(self, joint: int) -> float:
        """Return a joint's coordinate in the zero posture, rad or m."""
        return float(self.model.qpos0[self.model.jnt_qposadr[joint]])

    def losses(self, joint: int) -> dict[str, float]:
        """Return a joint's friction and damping, where they are not zero."""
        dof = self.model.jnt_dofadr[joint]
        friction, damping = self.model.dof_frictionloss[dof], self.model.dof_damping[dof]
        values = {"friction": float(friction), "damping": float(np.ravel(damping)[0])}
        return {key: value for key, value in values.items() if value}

    def drive(self, joint: int) -> dict[str, float]:
        """Return a joint's armature, kg m2, velocity, rad/s, and effort, N m, as far as stated.

        The effort is the largest that joint and actuators allow.
        """
        model, limits = self.model, [np.inf]
        if model.jnt_actfrclimited[joint]:
            limits.append(np.abs(model.jnt_actfrcrange[joint]).max())
        for i in np.flatnonzero(model.actuator_trnid[:, 0] == joint):
            gear, is_motor = abs(model.actuator_gear[i, 0]), model.actuator_biastype[i] == 0
            if model.actuator_forcelimited[i]:
                limits.append(gear * np.abs(model.actuator_forcerange[i]).max())
            if model.actuator_ctrllimited[i] and is_motor:
                gain = abs(model.actuator_gainprm[i, 0])
                limits.append(gear * gain * np.abs(model.actuator_ctrlrange[i]).max())
        values = {
            "armature": float(model.dof_armature[model.jnt_dofadr[joint]]),
            "velocity": self._velocities.get(self.joint(joint), 0.0),
            "effort": float(min(limits)),
        }
        return {key: value for key, value in values.items() if 0 < value < np.inf}

    def points(self, bodies: set[int]) -> list[Point]:
        """Return bodies' frames, sites, spheres and capsules' ends."""
        model, data = self.model, self.data
        points = [Point(self.body(i), data.xpos[i], 0.0) for i in sorted(bodies)]
        sites = (i for i in range(model.nsite) if model.site_bodyid[i] in bodies)
        points += [Point(model.site(i).name, data.site_xpos[i], 0.0) for i in sites]
        for kind, sides in ((_SPHERE, (0,)), (_CAPSULE, (-1, 1))):
            for i in np.flatnonzero(model.geom_type == kind):
                if (owner := int(model.geom_bodyid[i])) in bodies:
                    half = model.geom_size[i, 1] * data.geom_xmat[i].reshape(3, 3)[:, 2]
                    name, radius = model.geom(i).name or self.body(owner), model.geom_size[i, 0]
                    at = data.geom_xpos[i]
                    points += [Point(name, at + side * half, float(radius)) for side in sides]
        return points


def _parse(path: Path) -> Xml.Element:
    """Return the root of a URDF or MJCF file without entities and within bounds."""
    if not path.is_file():
        raise RobotError(f"There is no file {path}; give a URDF (.urdf) or MJCF (.xml) file.")
    if path.stat().st_size > _LARGEST_FILE:
        raise RobotError(f"{path} is larger than {_LARGEST_FILE >> 20} MiB, which no leg needs.")
    content = path.read_bytes()
    if b"<!DOCTYPE" in content:
        raise RobotError(f"{path} declares a document type or entities; remove its <!DOCTYPE>.")
    if b"<xacro:" in content:
        raise RobotError(f"{path} is a xacro template; expand it first: xacro {path} > leg.urdf.")
    try:
        root = Xml.fromstring(content)
    except (Xml.ParseError, ValueError, LookupError) as error:
        raise RobotError(f"{path} is not readable as XML: {one_line(error)}.") from error
    if root.tag not in ("robot", "mujoco"):
        raise RobotError(
            f"{path} holds <{one_line(root.tag)}> but must hold <robot>, URDF, or <mujoco>, MJCF."
        )
    elements = list(root.iter())
    if len(elements) > _MOST_ELEMENTS:
        raise RobotError(f"{path} has more than {_MOST_ELEMENTS} elements, which no leg needs.")
    for element in elements:
        if element.tag in _MULTIPLYING:
            raise RobotError(
                f"{path} has <{element.tag}>, which is not read; let MuJoCo write the whole model"
                " (mj_saveLastXML) and import that."
            )
    return root


def _prepare_urdf(root: Xml.Element) -> dict[str, float]:
    """Prepare a URDF for MuJoCo; return joints' largest velocities, which MuJoCo does not read.

    MuJoCo makes the root link the world, without mass, so that it gets a fixed joint to a world.
    """
    velocities = {}
    for joint in root.findall("joint"):
        for limit in joint.findall("limit[@velocity]"):
            with contextlib.suppress(ValueError):
                velocities[joint.get("name", "")] = float(limit.attrib["velocity"])
    for parent in list(root.iter()):
        parent[:] = [
            part
            for part in parent
            if part.tag not in ("material", "mimic", "mujoco")
            and part.find("geometry/mesh") is None
        ]
    links = [link.get("name", "") for link in root.findall("link")]
    children = {child.get("link") for child in root.findall("joint/child")}
    if "world" not in links:
        for top in [name for name in links if name not in children]:
            joint = Xml.SubElement(root, "joint", {"name": f"world to {top}", "type": "fixed"})
            Xml.SubElement(joint, "parent", {"link": "world"})
            Xml.SubElement(joint, "child", {"link": top})
        root.insert(0, Xml.Element("link", {"name": "world"}))
    options = {"discardvisual": "false", "fusestatic": "false", "balanceinertia": "false"}
    Xml.SubElement(Xml.SubElement(root, "mujoco"), "compiler", options)
    return velocities


def _make_movable(spec: mujoco.MjSpec) -> dict[str, float]:
    """Make MuJoCo take a URDF's bodies as they are; return what is added to moments, by body.

    It refuses bodies without mass and tensors that no rigid body has, which planar legs often
    state; a multiple of the identity makes each one valid.
    """
    spec.compiler.boundmass = spec.compiler.boundinertia = _NOTHING
    added = {}
    for body in spec.bodies:
        if body.explicitinertial:
            added[body.name] = 2 * float(np.abs(body.fullinertia).sum()) + _NOTHING
            body.fullinertia[:3] += added[body.name]
    return added
