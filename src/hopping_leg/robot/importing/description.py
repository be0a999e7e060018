"""What a URDF or MJCF file says of a robot, as MuJoCo reads it: bodies, joints, points in space.

MuJoCo compiles a copy that holds bodies, joints, simple shapes and actuators alone, so that neither
another file is opened nor anything multiplied. Everything stands where the file's zero posture puts
it, in the file's world frame, SI units.
"""

import re
import warnings
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal
from xml.etree import ElementTree as Xml
from xml.parsers import expat

import mujoco
import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.errors import RobotError
from hopping_leg.io import one_line

Kind = Literal["hinge", "slide", "other"]

_LARGEST_FILE = 16 << 20  # bytes
_MOST_ELEMENTS = 50_000
_MOST_BODIES = 1000
_FARTHEST = 1e6  # m
_NOTHING = 1e-12
"""Mass and inertia that stand for none, kg and kg m2: MuJoCo moves no body without them."""
_KEPT = {
    "mujoco": "compiler option default worldbody actuator",
    "default": "default joint geom site motor general position",
    "worldbody": "body frame geom site",
    "body": "body frame inertial joint freejoint geom site",
    "frame": "body frame inertial joint freejoint geom site",
    "actuator": "motor general position",
    "robot": "link joint",
    "link": "inertial collision visual",
    "inertial": "origin mass inertia",
    **dict.fromkeys(("collision", "visual"), "origin geometry"),
    "geometry": "sphere box cylinder",
}
"""Elements that are read, by where they stand; in a URDF's joints all."""
_KEPT_ATTRIBUTES = {
    "compiler": "angle autolimits balanceinertia boundinertia boundmass eulerseq inertiafromgeom"
    " inertiagrouprange settotalmass",
    "option": "gravity",
}
_DROPPED = ("material", "hfield", "plugin", "fluidshape", "user", "nsample", "nuser_body")
_REFUSED = ("include", "replicate", "attach", "composite", "flexcomp")
_KINDS: dict[int, Kind] = {
    int(mujoco.mjtJoint.mjJNT_HINGE): "hinge",
    int(mujoco.mjtJoint.mjJNT_SLIDE): "slide",
}


@dataclass(frozen=True)
class Body:
    """A rigid body."""

    name: str
    parent: int
    """Its place in the list of bodies, -1 for the root; parents come first."""
    mass: float
    com: Array
    """Centre of mass, m, (3,)."""
    inertia: Array
    """About the centre of mass, in world axes, kg m2, (3, 3)."""


@dataclass(frozen=True)
class TreeJoint:
    """A joint that may move."""

    name: str
    body: int
    """The body that it moves."""
    kind: Kind
    anchor: Array
    """A point of its axis, m, (3,)."""
    axis: Array
    """Unit vector, (3,)."""
    zero: float = 0.0
    """Its coordinate in the zero posture, rad or m."""
    facts: dict[str, float] = field(default_factory=dict)
    """What the file states: lower, upper, soft_lower, soft_upper (of its coordinate), effort,
    velocity, friction, damping, armature."""


@dataclass(frozen=True)
class Point:
    """A named point of a body: the origin of a frame, or the centre of a sphere."""

    name: str
    body: int
    position: Array
    """m, (3,)."""
    radius: float | None = None
    """Of the sphere, m; None for a frame."""


@dataclass(frozen=True)
class BodyTree:
    """A robot as its file describes it."""

    name: str
    up: Array
    """Against gravity, unit vector, (3,)."""
    bodies: list[Body]
    joints: list[TreeJoint]
    points: list[Point]
    ground: dict[str, float] = field(default_factory=dict)
    """The floor's time_constant, damping_ratio and friction, where the file has a floor."""
    notes: list[str] = field(default_factory=list)
    """Sentences about what the file has and is not read."""


def read_description(path: Path) -> BodyTree:
    """Return what a URDF or MJCF file describes.

    Raises:
        RobotError: The file is neither, MuJoCo refuses it, or a body's mass is that of a mesh.
    """
    root, origin = _parse(path), str(path)
    if any("xacro:" in element.tag for element in root.iter()):
        raise RobotError(
            f"{origin} is a xacro template; expand it first: xacro {origin} > leg.urdf."
        )
    if root.tag not in ("robot", "mujoco"):
        raise RobotError(
            f"{origin} holds <{one_line(root.tag)}> but must hold <robot>, URDF, or <mujoco>, MJCF."
        )
    for element in root.iter():
        if element.tag in _REFUSED:
            raise RobotError(
                f"{origin} has <{element.tag}>, which is not read; let MuJoCo write the whole model"
                " (mj_saveLastXML) and import that."
            )
        for key, value in element.attrib.items():
            if key not in ("name", "class") and "nan" in value.lower().split():
                raise RobotError(f"{origin}: {key} of <{element.tag}> is no number (NaN).")
    loops = len(root.findall("equality/*"))
    stated, added = ({}, {}) if root.tag == "mujoco" else _prepare_urdf(root)
    model = _compiled(root, origin)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    if not all(np.all(np.abs(x) < _FARTHEST) for x in (data.xipos, data.geom_xpos, data.xaxis)):
        raise RobotError(
            f"{origin}: its bodies lie farther away than any leg's; check its numbers."
        )
    down = model.opt.gravity
    if not np.linalg.norm(down) > 0:
        raise RobotError(f"{origin} has no gravity, which says where down is.")
    return BodyTree(
        root.get("model" if root.tag == "mujoco" else "name", "").strip() or "leg",
        -down / np.linalg.norm(down),
        _bodies(model, data, added),
        _joints(model, data, stated),
        _points(model, data),
        _ground(model),
        [f"{loops} equality constraints are left out."] if loops else [],
    )


def _parse(path: Path) -> Xml.Element:
    """Return the root of an XML file without entities and within bounds."""
    if not path.is_file():
        raise RobotError(f"There is no file {path}; give a URDF (.urdf) or MJCF (.xml) file.")
    if path.stat().st_size > _LARGEST_FILE:
        raise RobotError(f"{path} is larger than {_LARGEST_FILE >> 20} MiB, which no leg needs.")
    builder, parser, count = Xml.TreeBuilder(), expat.ParserCreate(), dict[str, int]()

    def start(tag: str, attributes: dict[str, str]) -> None:
        count[tag] = count.get(tag, 0) + 1
        if count[tag] > (_MOST_BODIES if tag in ("link", "body", "joint") else _MOST_ELEMENTS):
            raise RobotError(f"{path} has more than {count[tag] - 1} <{tag}>; a leg needs a few.")
        builder.start(tag, attributes)

    def refuse(*_: object) -> None:
        raise RobotError(f"{path} declares a document type or entities; remove its <!DOCTYPE>.")

    parser.StartElementHandler, parser.EndElementHandler = start, builder.end
    parser.CharacterDataHandler = builder.data
    parser.StartDoctypeDeclHandler = refuse
    try:
        parser.Parse(path.read_bytes(), True)
    except (expat.ExpatError, ValueError, LookupError) as error:
        raise RobotError(f"{path} is not readable as XML: {one_line(error)}.") from error
    return builder.close()


def _number(element: Xml.Element, attribute: str) -> float | None:
    """Return an attribute's number; None where it is absent or none, which MuJoCo then says."""
    try:
        return float(element.get(attribute, ""))
    except ValueError:
        return None


def _prepare_urdf(root: Xml.Element) -> tuple[dict[str, dict[str, float]], dict[str, float]]:
    """Prepare a URDF for MuJoCo; return what MuJoCo does not read of its joints, and added inertia.

    MuJoCo makes the root link the world, without mass, so that the root gets a fixed joint to
    a world. It refuses tensors that no rigid body has, which planar legs often state; a multiple of
    the identity, told by link and later subtracted, makes each one valid.
    """
    links = {link.get("name", ""): link for link in root.findall("link")}
    children = {child.get("link", "") for child in root.findall("joint/child")}
    if "world" not in links:
        tops = [name for name in links if name not in children] or list(links)[:1]
        if not any(parent.get("link") == "world" for parent in root.findall("joint/parent")):
            for top in tops:
                joint = Xml.SubElement(root, "joint", {"name": f"world to {top}", "type": "fixed"})
                Xml.SubElement(joint, "parent", {"link": "world"})
                Xml.SubElement(joint, "child", {"link": top})
        root.insert(0, Xml.Element("link", {"name": "world"}))
    added = {}
    for name, link in links.items():
        for tensor in link.findall("inertial/inertia"):
            moments = {key: _number(tensor, key) or 0.0 for key in ("ixx", "iyy", "izz")}
            added[name] = 2 * sum(map(abs, moments.values())) + _NOTHING
            tensor.attrib |= {key: repr(value + added[name]) for key, value in moments.items()}
    stated: dict[str, dict[str, float]] = {}
    for joint in root.findall("joint"):
        facts = stated.setdefault(joint.get("name", ""), {})
        if joint.find("mimic") is not None:
            facts["mimic"] = 1.0
        for tag, attribute, fact in (
            ("limit", "effort", "effort"),
            ("limit", "velocity", "velocity"),
            ("safety_controller", "soft_lower_limit", "soft_lower"),
            ("safety_controller", "soft_upper_limit", "soft_upper"),
        ):
            for element in joint.findall(tag):
                if (value := _number(element, attribute)) is not None:
                    facts[fact] = value
    return stated, added


def _stripped(root: Xml.Element) -> Xml.Element:
    """Return a copy with nothing but what is read."""
    copy = Xml.Element(root.tag, root.attrib if root.tag == "robot" else {})
    queue = [(root, copy)]
    while queue:
        source, target = queue.pop()
        for child in source:
            if child.tag not in _KEPT[target.tag].split():
                continue
            kept = {k: v for k, v in child.attrib.items() if k not in _DROPPED}
            if child.tag in _KEPT_ATTRIBUTES:
                kept = {k: v for k, v in kept.items() if k in _KEPT_ATTRIBUTES[child.tag].split()}
            if target.tag == "actuator" and "joint" not in kept:
                continue
            if child.tag in ("collision", "visual") and child.find("geometry/mesh") is not None:
                continue
            element = Xml.SubElement(target, child.tag, kept)
            if child.tag in _KEPT:
                queue.append((child, element))
            elif target.tag == "robot":
                element.extend(part for part in child if part.tag != "mimic")
    if root.tag == "robot":
        options = {
            "fusestatic": "false", "discardvisual": "false", "balanceinertia": "false",
            "boundmass": str(_NOTHING), "boundinertia": str(_NOTHING),
        }  # fmt: skip
        Xml.SubElement(Xml.SubElement(copy, "mujoco"), "compiler", options)
    return copy


def _compiled(root: Xml.Element, origin: str) -> mujoco.MjModel:
    """Return MuJoCo's model without its meshes."""
    try:
        spec = mujoco.MjSpec.from_string(Xml.tostring(_stripped(root), encoding="unicode"))
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
    except (ValueError, mujoco.FatalError, RecursionError) as error:
        why = re.sub(r", line \d+", "", one_line(error)).rstrip(".")  # a line of the copy
        raise RobotError(f"{origin} is no model that MuJoCo reads: {why}.") from error


def _name(model: mujoco.MjModel, kind: mujoco.mjtObj, number: int) -> str:
    return mujoco.mj_id2name(model, kind, number) or f"unnamed {number}"


def _bodies(model: mujoco.MjModel, data: mujoco.MjData, added: dict[str, float]) -> list[Body]:
    bodies = []
    for i in range(model.nbody):
        name, axes = _name(model, mujoco.mjtObj.mjOBJ_BODY, i), data.ximat[i].reshape(3, 3)
        inertia = axes @ np.diag(model.body_inertia[i] - added.get(name, 0.0)) @ axes.T
        mass, parent = float(model.body_mass[i]), int(model.body_parentid[i]) if i else -1
        if mass <= 2 * _NOTHING:
            mass, inertia = 0.0, np.zeros((3, 3))
        bodies.append(Body(name, parent, mass, data.xipos[i].copy(), inertia))
    return bodies


def _joints(
    model: mujoco.MjModel, data: mujoco.MjData, stated: dict[str, dict[str, float]]
) -> list[TreeJoint]:
    efforts = _efforts(model)
    joints = []
    for i in range(model.njnt):
        name, dof = _name(model, mujoco.mjtObj.mjOBJ_JOINT, i), int(model.jnt_dofadr[i])
        facts = {
            "friction": float(model.dof_frictionloss[dof]),
            "damping": float(np.ravel(model.dof_damping[dof])[0]),
            "armature": float(model.dof_armature[dof]),
            "effort": efforts.get(i, 0.0),
            **stated.get(name, {}),
        }
        mimics = facts.pop("mimic", None)
        kind = _KINDS.get(-1 if mimics else int(model.jnt_type[i]), "other")
        facts = {k: v for k, v in facts.items() if v}
        if model.jnt_limited[i]:
            facts["lower"], facts["upper"] = map(float, model.jnt_range[i])
        zero = float(model.qpos0[int(model.jnt_qposadr[i])])
        anchor, axis = data.xanchor[i].copy(), data.xaxis[i].copy()
        joints.append(TreeJoint(name, int(model.jnt_bodyid[i]), kind, anchor, axis, zero, facts))
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
