"""MJCF into a ``BodyTree``: MuJoCo's own compiler resolves it, of a copy without meshes.

The copy holds bodies, joints, sites, geoms, actuators and defaults alone, so that neither another
file is opened nor anything multiplied.
"""

import warnings
from typing import Literal
from xml.etree import ElementTree as Xml

import mujoco
import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.errors import RobotError
from hopping_leg.io import one_line
from hopping_leg.robot.importing.body_tree import Body, BodyTree, Point, TreeJoint

_KEPT = {
    "mujoco": "compiler option default worldbody actuator",
    "default": "default joint geom site motor general position",
    "worldbody": "body frame geom site",
    "body": "body frame inertial joint freejoint geom site",
    "frame": "body frame inertial joint freejoint geom site",
    "actuator": "motor general position",
}
"""Elements that are read, by where they stand."""
_REFUSED = {
    "include": "copy the included file's content in",
    "replicate": "write each copy out",
    "attach": "write the attached body out",
    "composite": "a leg consists of rigid bodies",
    "flexcomp": "a leg consists of rigid bodies",
}
_DROPPED = ("material", "hfield", "plugin", "fluidshape", "user", "nsample", "nuser_body")
_COMPILER = (
    "angle", "autolimits", "balanceinertia", "boundinertia", "boundmass", "eulerseq",
    "inertiafromgeom", "inertiagrouprange", "settotalmass",
)  # fmt: skip
_FARTHEST = 1e6  # m
_KINDS: dict[int, Literal["hinge", "slide"]] = {
    int(mujoco.mjtJoint.mjJNT_HINGE): "hinge",
    int(mujoco.mjtJoint.mjJNT_SLIDE): "slide",
}


def read_mjcf(root: Xml.Element, origin: str) -> BodyTree:
    """Return what a ``<mujoco>`` describes; messages name ``origin``.

    Raises:
        RobotError: MuJoCo refuses it, or a body's mass is that of a mesh.
    """
    for element in root.iter():
        if element.tag in _REFUSED:
            raise RobotError(
                f"{origin} has <{element.tag}>, which is not read; {_REFUSED[element.tag]}, or let"
                " MuJoCo write the whole model (mj_saveLastXML) and import that."
            )
        for key, value in element.attrib.items():
            if key not in ("name", "class") and "nan" in value.lower().split():
                raise RobotError(f"{origin}: {key} of <{element.tag}> is no number (NaN).")
    loops = len(root.findall("equality/*"))
    model = _compiled(_stripped(root), origin)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    if not all(np.all(np.abs(x) < _FARTHEST) for x in (data.xipos, data.geom_xpos, data.xaxis)):
        raise RobotError(
            f"{origin}: its bodies lie farther away than any leg's; check its numbers."
        )
    down = model.opt.gravity
    if not np.linalg.norm(down) > 0:
        raise RobotError(f"{origin} has no gravity, which says where down is.")
    notes = [f"{loops} equality constraints are left out."] if loops else []
    return BodyTree(
        root.get("model", "").strip() or "leg",
        -down / np.linalg.norm(down),
        _bodies(model, data),
        _joints(model, data),
        _points(model, data),
        _ground(model),
        notes,
    )


def _stripped(root: Xml.Element) -> str:
    """Return the XML with nothing but what is read."""
    copy = Xml.Element("mujoco")
    queue = [(root, copy)]
    while queue:
        source, target = queue.pop()
        for child in source:
            if child.tag not in _KEPT[target.tag].split():
                continue
            kept = {k: v for k, v in child.attrib.items() if k not in _DROPPED}
            if child.tag in ("compiler", "option"):
                valid = _COMPILER if child.tag == "compiler" else ("gravity",)
                kept = {k: v for k, v in kept.items() if k in valid}
            if target.tag == "actuator" and "joint" not in kept:
                continue
            element = Xml.SubElement(target, child.tag, kept)
            if child.tag in _KEPT:
                queue.append((child, element))
    return Xml.tostring(copy, encoding="unicode")


def _compiled(text: str, origin: str) -> mujoco.MjModel:
    """Return MuJoCo's model without its meshes."""
    try:
        spec = mujoco.MjSpec.from_string(text)
        always = spec.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
        for geom in list(spec.geoms):
            if geom.type != mujoco.mjtGeom.mjGEOM_MESH and not geom.meshname:
                continue
            body = geom.parent
            weighs = geom.mass != 0 and (geom.mass > 0 or geom.density > 0)
            if weighs and (always or not body.explicitinertial) and body.name != "world":
                raise RobotError(
                    f"{origin}: body '{body.name}' weighs what its mesh '{geom.meshname}' weighs,"
                    " and meshes are not read; give the body an <inertial>, e.g. the one that"
                    ' MuJoCo writes (<compiler saveinertial="true"/>, then mj_saveLastXML).'
                )
            spec.delete(geom)
        with warnings.catch_warnings(action="ignore"):  # of what is deprecated
            return spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        raise RobotError(f"{origin} is no model that MuJoCo reads: {one_line(error)}.") from error


def _name(model: mujoco.MjModel, kind: mujoco.mjtObj, number: int) -> str:
    return mujoco.mj_id2name(model, kind, number) or f"unnamed {number}"


def _bodies(model: mujoco.MjModel, data: mujoco.MjData) -> list[Body]:
    bodies = []
    for i in range(model.nbody):
        axes = data.ximat[i].reshape(3, 3)
        inertia = axes @ np.diag(model.body_inertia[i]) @ axes.T
        parent = int(model.body_parentid[i]) if i else -1
        name = _name(model, mujoco.mjtObj.mjOBJ_BODY, i)
        bodies.append(Body(name, parent, float(model.body_mass[i]), data.xipos[i].copy(), inertia))
    return bodies


def _joints(model: mujoco.MjModel, data: mujoco.MjData) -> list[TreeJoint]:
    efforts = _efforts(model)
    joints = []
    for i in range(model.njnt):
        at, dof = int(model.jnt_qposadr[i]), int(model.jnt_dofadr[i])
        facts = {
            "friction": float(model.dof_frictionloss[dof]),
            "damping": float(np.ravel(model.dof_damping[dof])[0]),
            "armature": float(model.dof_armature[dof]),
        }
        if model.jnt_limited[i]:
            facts["lower"], facts["upper"] = map(float, model.jnt_range[i])
        if i in efforts:
            facts["effort"] = efforts[i]
        facts = {k: v for k, v in facts.items() if v or k in ("lower", "upper")}
        joints.append(
            TreeJoint(
                _name(model, mujoco.mjtObj.mjOBJ_JOINT, i), int(model.jnt_bodyid[i]),
                _KINDS.get(int(model.jnt_type[i]), "other"), data.xanchor[i].copy(),
                data.xaxis[i].copy(), float(model.qpos0[at]), facts,
            )
        )  # fmt: skip
    return joints


def _efforts(model: mujoco.MjModel) -> dict[int, float]:
    """Return the largest force of joints whose actuators have a limit, by joint, N m."""
    efforts: dict[int, float] = {}
    for i in range(model.nu):
        joint, gear = int(model.actuator_trnid[i, 0]), abs(float(model.actuator_gear[i, 0]))
        is_motor = model.actuator_biastype[i] == mujoco.mjtBias.mjBIAS_NONE
        limits = []
        if model.actuator_forcelimited[i]:
            limits.append(gear * float(np.abs(model.actuator_forcerange[i]).max()))
        if model.actuator_ctrllimited[i] and is_motor:
            gain = abs(float(model.actuator_gainprm[i, 0]))
            limits.append(gear * gain * float(np.abs(model.actuator_ctrlrange[i]).max()))
        if limits:
            efforts[joint] = min(limits)
    for limited in map(int, np.flatnonzero(model.jnt_actfrclimited)):
        most = float(np.abs(model.jnt_actfrcrange[limited]).max())
        efforts[limited] = min(most, efforts.get(limited, most))
    return efforts


def _points(model: mujoco.MjModel, data: mujoco.MjData) -> list[Point]:
    """Return frames of bodies and sites, and spheres, those at a capsule's ends too."""
    body, site, geom = mujoco.mjtObj.mjOBJ_BODY, mujoco.mjtObj.mjOBJ_SITE, mujoco.mjtObj.mjOBJ_GEOM
    points = [Point(_name(model, body, i), i, data.xpos[i].copy()) for i in range(1, model.nbody)]
    points += [
        Point(_name(model, site, i), int(model.site_bodyid[i]), data.site_xpos[i].copy())
        for i in range(model.nsite)
    ]
    spheres_first = np.argsort(model.geom_type != mujoco.mjtGeom.mjGEOM_SPHERE, kind="stable")
    for i in map(int, spheres_first):
        owner = int(model.geom_bodyid[i])
        name = mujoco.mj_id2name(model, geom, i) or _name(model, body, owner)
        for centre in _centres(model, data, i):
            points.append(Point(name, owner, centre, float(model.geom_size[i, 0])))
    return points


def _centres(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> list[Array]:
    """Return the centres of the spheres that a geom is or ends in."""
    at = data.geom_xpos[geom].copy()
    if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_SPHERE:
        return [at]
    if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_CAPSULE:
        half = model.geom_size[geom, 1] * data.geom_xmat[geom].reshape(3, 3)[:, 2]
        return [at - half, at + half]
    return []


def _ground(model: mujoco.MjModel) -> dict[str, float]:
    """Return the contact of the world's first plane, as far as MuJoCo states it as times."""
    for plane in np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE):
        ground = {"friction": float(model.geom_friction[plane, 0])}
        if model.geom_solref[plane, 0] > 0:
            ground["time_constant"], ground["damping_ratio"] = map(float, model.geom_solref[plane])
        return ground
    return {}
