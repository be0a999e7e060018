"""A URDF or MJCF file as MuJoCo reads it; no mesh is opened.

Everything stands where the file's zero posture puts it, in the file's world frame, SI units.
"""

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

_NOTHING = 1e-12
"""Mass and inertia that stand for none, kg and kg m2: MuJoCo moves no body without them."""

_UNREAD = (
    *("equalities", "excludes", "flexes", "hfields", "keys", "materials", "meshes", "pairs"),
    *("sensors", "skins", "tendons", "textures"),
)
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

    RobotError says that the file is neither URDF nor MJCF, that MuJoCo refuses it, or that a body's
    mass is that of a mesh.
    """

    def __init__(self, path: Path) -> None:
        if not path.is_file():
            raise RobotError(f"There is no file {path}; give a URDF (.urdf) or MJCF (.xml) file.")
        if b"<xacro:" in path.read_bytes():
            raise RobotError(f"{path} is a template; expand it first: xacro {path} > leg.urdf.")
        self.origin = str(path)
        try:
            root = Xml.parse(path).getroot()
            self._velocities = {
                joint.get("name", ""): float(limit.attrib["velocity"])
                for joint in root.iterfind("joint")
                for limit in joint.iterfind("limit[@velocity]")
            }
            spec = mujoco.MjSpec.from_file(str(path))
            self.name = spec.modelname.strip() or "leg"
            self.loops = len(spec.equalities)
            """Constraints that close a loop, which are left out."""
            for geom in filter(_needs_file, spec.geoms if root.tag == "mujoco" else ()):
                body, weighs = geom.parent, geom.mass > 0 or (geom.mass != 0 and geom.density > 0)
                if weighs and not body.explicitinertial and body.name != "world":
                    raise RobotError(
                        f"{path}: body '{body.name}' weighs what its mesh '{geom.meshname}' weighs,"
                        " and meshes are not read; give the body an <inertial>."
                    )
            shaped = [bool(b.explicitinertial or b.geoms) for b in spec.bodies]
            _leave_out(spec)
            with warnings.catch_warnings(action="ignore"):  # of what is deprecated
                self.model = spec.compile()
        except (ValueError, LookupError, Xml.ParseError, mujoco.FatalError) as error:
            said = f"{path} is no model that MuJoCo reads: {one_line(error)}."
            if "A + B >= C" in said:
                said = f"{path}: one principal moment of inertia exceeds the others' sum, kg m2:"
                said += f" {', '.join(_impossible_inertias(spec))}; export them with more digits,"
                said += " or add as much to each of ixx, iyy and izz."
            raise RobotError(said) from error
        self.weightless = {*np.flatnonzero(shaped).tolist()} - {*self.heavy(range(len(shaped)))}
        """Bodies of no mass for which the file has an inertia or a shape."""
        self.data = mujoco.MjData(self.model)
        mujoco.mj_kinematics(self.model, self.data)
        strength = np.linalg.norm(self.model.opt.gravity)
        if not strength > 0:
            raise RobotError(f"{path} has no gravity, which says where down is.")
        self.up = -self.model.opt.gravity / strength
        """Against gravity, unit vector, (3,)."""

    def joint(self, number: int) -> str:
        """Return a joint's name."""
        return str(self.model.joint(number).name)

    def body(self, number: int) -> str:
        """Return a body's name."""
        return str(self.model.body(number).name)

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

    def numbers(self, joint: int) -> dict[str, float]:
        """Return what is stated of a joint: friction, damping, armature, velocity and effort.

        The effort is the largest that joint and actuators allow; SI units.
        """
        model, dof, limits = self.model, self.model.jnt_dofadr[joint], [np.inf]
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
            "friction": float(model.dof_frictionloss[dof]),
            "damping": float(np.ravel(model.dof_damping[dof])[0]),
            "armature": float(model.dof_armature[dof]),
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


def _needs_file(geom: mujoco.MjsGeom) -> bool:
    return geom.type in _OF_FILES or bool(geom.meshname)


def _impossible_inertias(spec: mujoco.MjSpec) -> Iterator[str]:
    """Yield the bodies whose inertia no mass has, and what to add to its principal moments."""
    for body in spec.bodies:
        xx, yy, zz, xy, xz, yz = body.fullinertia
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        small, middle, large = np.linalg.eigvalsh(np.diag(body.inertia) if np.isnan(xx) else tensor)
        if (gap := large - middle - small) > 0:
            yield f"'{body.name}' has {small:.4g}, {middle:.4g}, {large:.4g} (add {1.01 * gap:.3g})"


def _leave_out(spec: mujoco.MjSpec) -> None:
    """Leave out what needs other files and what makes no leg; name what has no name."""
    for part in (*spec.geoms, *spec.sites):
        part.material = ""
    unread = [*filter(_needs_file, spec.geoms)]
    unread += [a for a in spec.actuators if a.trntype != mujoco.mjtTrn.mjTRN_JOINT]
    for part in [*unread, *(part for kind in _UNREAD for part in getattr(spec, kind))]:
        spec.delete(part)
    for parts in (spec.bodies, spec.joints):
        for number, part in enumerate(parts):
            part.name = part.name or f"unnamed {number}"
    spec.compiler.fusestatic = spec.compiler.discardvisual = False
    spec.compiler.boundmass = spec.compiler.boundinertia = _NOTHING
