"""URDF into a ``BodyTree``. Meshes and what else only shows or simulates is not read.

Of a transmission the reduction counts, and Drake's ``drake:rotor_inertia`` and
``drake:gear_ratio``, the reflected inertia's two factors.
"""

from typing import Literal
from xml.etree import ElementTree as Xml

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.errors import RobotError, unknown_name
from hopping_leg.io import one_line
from hopping_leg.robot.importing.body_tree import Body, BodyTree, Point, TreeJoint
from hopping_leg.robot.importing.xml_file import number, numbers

_KINDS: dict[str, Literal["hinge", "slide"]] = {
    "revolute": "hinge",
    "continuous": "hinge",
    "prismatic": "slide",
}
_OTHER = ("fixed", "floating", "planar")
_DRAKE = {f"drake:{key}": key for key in ("rotor_inertia", "gear_ratio")}
_WORLD = "world"
"""Root that Drake knows without its being declared."""
_ZEROS, _UNIT_X = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0)

Pose = tuple[Array, Array]
"""Position, (3,), and rotation, (3, 3)."""


def read_urdf(root: Xml.Element, origin: str) -> BodyTree:
    """Return what a ``<robot>`` describes; messages name ``origin``.

    Raises:
        RobotError: Links or joints are not as URDF has them.
    """
    links = _by_name(root, "link", origin)
    if not links:
        raise RobotError(f"{origin} has no <link>; is it a robot's URDF?")
    joints_by_name = _by_name(root, "joint", origin)
    if any(end.get("link") == _WORLD for end in root.findall("joint/parent")):
        links.setdefault(_WORLD, Xml.Element("link", name=_WORLD))
    arriving = _arriving_joints(joints_by_name, links, origin)
    roots = [name for name in links if name not in arriving]
    if len(roots) != 1:
        what = f"links without a parent: {', '.join(roots)}" if roots else "joints run in a circle"
        raise RobotError(
            f"{origin} has no single root link ({what}); joints must lead from it to all others."
        )
    children: dict[str, list[str]] = {name: [] for name in links}
    for child, joint in arriving.items():
        children[_end(joint, "parent", links, origin)].append(child)
    bodies: list[Body] = []
    joints: list[TreeJoint] = []
    points: list[Point] = []
    queue: list[tuple[str, int, Pose]] = [(roots[0], -1, (np.zeros(3), np.eye(3)))]
    while queue:
        name, parent, above = queue.pop(0)
        pose = above
        if name in arriving:
            joint = arriving[name]
            pose = _compose(above, _pose(joint, f"{origin}: joint '{joint.get('name')}'"))
            if joint.get("type") != "fixed":
                joints.append(_joint(joint, len(bodies), pose, origin))
        points += _points(links[name], len(bodies), pose, f"{origin}: link '{name}'")
        queue += [(child, len(bodies), pose) for child in children[name]]
        bodies.append(_body(links[name], parent, pose, f"{origin}: link '{name}'"))
    if len(bodies) < len(links):
        raise RobotError(f"{origin}: the joints of some links run in a circle.")
    _add_transmissions(root, {joint.name: joint.facts for joint in joints}, origin)
    name = root.get("name", "").strip() or "leg"
    return BodyTree(name, np.array([0.0, 0.0, 1.0]), bodies, joints, points)


def _by_name(root: Xml.Element, tag: str, origin: str) -> dict[str, Xml.Element]:
    found: dict[str, Xml.Element] = {}
    for element in root.findall(tag):
        name = element.get("name", "")
        if not name or name in found:
            why = f"two <{tag}> are named {one_line(name)}" if name else f"a <{tag}> has no name"
            raise RobotError(f"{origin}: {why}; each needs a name of its own.")
        found[name] = element
    return found


def _arriving_joints(
    joints: dict[str, Xml.Element], links: dict[str, Xml.Element], origin: str
) -> dict[str, Xml.Element]:
    """Return each link's joint to its parent."""
    arriving: dict[str, Xml.Element] = {}
    for name, joint in joints.items():
        kind = joint.get("type", "")
        if kind not in (*_KINDS, *_OTHER):
            valid = unknown_name("type of joint", kind, (*_KINDS, *_OTHER))
            raise RobotError(f"{origin}: joint '{name}': {valid}")
        child = _end(joint, "child", links, origin)
        if child in arriving:
            other = arriving[child].get("name")
            raise RobotError(f"{origin}: link '{child}' is the child of '{other}' and of '{name}'.")
        arriving[child] = joint
    return arriving


def _end(joint: Xml.Element, tag: str, links: dict[str, Xml.Element], origin: str) -> str:
    element = joint.find(tag)
    name = "" if element is None else element.get("link", "")
    if name not in links:
        valid = unknown_name("link", name, links)
        raise RobotError(f"{origin}: the {tag} of joint '{joint.get('name')}': {valid}")
    return name


def _pose(element: Xml.Element, where: str) -> Pose:
    """Return the pose that an element's <origin> states."""
    at = element.find("origin")
    if at is None:
        return np.zeros(3), np.eye(3)
    roll, pitch, yaw = numbers(at, "rpy", _ZEROS, where)
    turns = [_turn(2, yaw), _turn(1, pitch), _turn(0, roll)]
    return numbers(at, "xyz", _ZEROS, where), turns[0] @ turns[1] @ turns[2]


def _turn(axis: int, angle: float) -> Array:
    """Return the rotation about a coordinate axis."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix: Array = np.eye(3)
    matrix[i, i] = matrix[j, j] = np.cos(angle)
    matrix[j, i] = np.sin(angle)
    matrix[i, j] = -matrix[j, i]
    return matrix


def _compose(outer: Pose, inner: Pose) -> Pose:
    return outer[0] + outer[1] @ inner[0], outer[1] @ inner[1]


def _joint(element: Xml.Element, body: int, pose: Pose, origin: str) -> TreeJoint:
    name, where = element.get("name", ""), f"{origin}: joint '{element.get('name')}'"
    along = element.find("axis")
    axis = np.array(_UNIT_X) if along is None else numbers(along, "xyz", _UNIT_X, where)
    length = float(np.linalg.norm(axis))
    if not length > 0:
        raise RobotError(f"{where} has an <axis> of length zero.")
    limit, soft, dynamics = (element.find(t) for t in ("limit", "safety_controller", "dynamics"))
    facts = {
        "effort": number(limit, "effort", where),
        "velocity": number(limit, "velocity", where),
        "soft_lower": number(soft, "soft_lower_limit", where),
        "soft_upper": number(soft, "soft_upper_limit", where),
        "damping": number(dynamics, "damping", where),
        "friction": number(dynamics, "friction", where),
    }
    kind = element.get("type", "")
    if kind != "continuous":
        facts |= {end: number(limit, end, where) for end in ("lower", "upper")}
    return TreeJoint(
        name, body,
        "other" if element.find("mimic") is not None else _KINDS.get(kind, "other"),
        pose[0], pose[1] @ (axis / length),
        facts={key: value for key, value in facts.items() if value is not None},
    )  # fmt: skip


def _body(link: Xml.Element, parent: int, pose: Pose, where: str) -> Body:
    name, inertial = link.get("name", ""), link.find("inertial")
    if inertial is None:
        return Body(name, parent, 0.0, pose[0], np.zeros((3, 3)))
    at, turn = _compose(pose, _pose(inertial, where))
    mass = number(inertial.find("mass"), "value", where) or 0.0
    if mass < 0:
        raise RobotError(f"{where} has a mass of {mass:g} kg.")
    tensor, matrix = inertial.find("inertia"), np.zeros((3, 3))
    for key, (i, j) in {
        "ixx": (0, 0), "iyy": (1, 1), "izz": (2, 2), "ixy": (0, 1), "ixz": (0, 2), "iyz": (1, 2),
    }.items():  # fmt: skip
        matrix[i, j] = matrix[j, i] = number(tensor, key, where) or 0.0
    return Body(name, parent, mass, at, turn @ matrix @ turn.T)


def _points(link: Xml.Element, body: int, pose: Pose, where: str) -> list[Point]:
    """Return a link's origin and the centres of its spheres."""
    name = link.get("name", "")
    points = [Point(name, body, pose[0])]
    for shape in (*link.findall("collision"), *link.findall("visual")):
        radius = number(shape.find("geometry/sphere"), "radius", where)
        if radius is not None:
            points.append(Point(name, body, _compose(pose, _pose(shape, where))[0], radius))
    return points


def _add_transmissions(root: Xml.Element, facts: dict[str, dict[str, float]], origin: str) -> None:
    """Add what transmissions state to the facts of their joints."""
    for transmission in root.findall("transmission"):
        joint = transmission.find("joint")
        name = "" if joint is None else joint.get("name", "")
        if name not in facts:
            continue
        where = f"{origin}: the transmission of '{name}'"
        for path in (".", "joint", "actuator"):
            if (text := transmission.findtext(f"{path}/mechanicalReduction")) is not None:
                read = Xml.Element("mechanicalReduction", value=text)
                facts[name]["reduction"] = abs(number(read, "value", where) or 0.0)
        for element in transmission.findall("actuator/*"):
            value = number(element, "value", where)
            if element.tag in _DRAKE and value is not None:
                facts[name][_DRAKE[element.tag]] = value
