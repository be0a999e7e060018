"""URDF of a leg, for users of other tools.

URDF knows neither a motor's reflected inertia, which stands in a comment at each joint, nor its
torque-speed limit: a joint's ``velocity`` is the speed at which its motor has no torque left. Its
``limit`` are the mechanical stops. All is at the joint's side of the belt.
"""

from xml.etree import ElementTree as Xml

from hopping_leg.robot.parameters import Joint, Link, Robot

_RAIL_TOP = 0.8
"""Upper end of the rail as drawn in leg.xml, m."""

_THIN = 1e-9
"""Inertia around the axes a planar link cannot turn about only has to be valid, kg m2."""

_LINK_RADIUS = 0.012


def to_urdf(robot: Robot) -> str:
    """Return the leg as URDF: rail (passive), hip, knee, and a fixed frame ``foot``.

    The world's z is up, positive angles swing the foot to +x, zero is the straight leg downwards.
    """
    root = Xml.Element("robot", name=robot.name)
    Xml.SubElement(root, "link", name="world")
    base = _link(root, "base", robot.base.mass, 0.0, _THIN)
    _shape(base, "collision", "sphere", 0.0, radius=robot.base.radius)
    _shape(base, "visual", "sphere", 0.0, radius=robot.base.radius)
    _swinging_link(root, "thigh", robot.thigh)
    shank = _swinging_link(root, "shank", robot.shank)
    _shape(shank, "collision", "sphere", 0.0, radius=robot.knee_cap.radius)
    for role in ("collision", "visual"):
        _shape(shank, role, "sphere", -robot.shank.length, radius=robot.foot.radius)
    _link(root, "foot", 0.0, 0.0, 0.0)  # PyBullet gives a link without inertia a mass of 1 kg
    _rail(root, robot)
    _hinge(root, "hip", "base", "thigh", 0.0, robot.hip)
    _hinge(root, "knee", "thigh", "shank", -robot.thigh.length, robot.knee)
    tip = _joint(root, "fixed", "foot_tip", "shank", "foot", -robot.shank.length)
    tip.append(Xml.Comment(" centre of the foot's sphere "))
    Xml.indent(root)
    text: str = Xml.tostring(root, encoding="unicode")
    return f'<?xml version="1.0"?>\n{text}\n'


def _link(root: Xml.Element, name: str, mass: float, com_z: float, inertia: float) -> Xml.Element:
    link = Xml.SubElement(root, "link", name=name)
    inertial = Xml.SubElement(link, "inertial")
    _origin(inertial, com_z)
    Xml.SubElement(inertial, "mass", value=_text(mass))
    moments = {"ixx": inertia, "iyy": inertia, "izz": min(inertia, _THIN)}
    products = {"ixy": 0.0, "ixz": 0.0, "iyz": 0.0}
    Xml.SubElement(inertial, "inertia", {k: _text(v) for k, v in (moments | products).items()})
    return link


def _swinging_link(root: Xml.Element, name: str, link: Link) -> Xml.Element:
    element = _link(root, name, link.mass, -link.com, link.inertia)
    _shape(element, "visual", "cylinder", -link.length / 2, radius=_LINK_RADIUS, length=link.length)
    return element


def _shape(link: Xml.Element, role: str, kind: str, z: float, **size: float) -> None:
    element = Xml.SubElement(link, role)
    _origin(element, z)
    geometry = Xml.SubElement(element, "geometry")
    Xml.SubElement(geometry, kind, {key: _text(value) for key, value in size.items()})


def _joint(
    root: Xml.Element, kind: str, name: str, parent: str, child: str, z: float
) -> Xml.Element:
    joint = Xml.SubElement(root, "joint", name=name, type=kind)
    _origin(joint, z)
    Xml.SubElement(joint, "parent", link=parent)
    Xml.SubElement(joint, "child", link=child)
    return joint


def _rail(root: Xml.Element, robot: Robot) -> None:
    joint = _joint(root, "prismatic", "rail", "world", "base", 0.0)
    Xml.SubElement(joint, "axis", xyz="0 0 1")
    limit = {"lower": "0", "upper": _text(_RAIL_TOP), "effort": "0", "velocity": "100"}
    Xml.SubElement(joint, "limit", limit)
    rail = robot.rail
    Xml.SubElement(joint, "dynamics", damping=_text(rail.damping), friction=_text(rail.friction))


def _hinge(root: Xml.Element, name: str, parent: str, child: str, z: float, joint: Joint) -> None:
    hinge = _joint(root, "revolute", name, parent, child, z)
    Xml.SubElement(hinge, "axis", xyz="0 -1 0")
    limit = {"lower": joint.stop_lower, "upper": joint.stop_upper}
    limit |= {"effort": joint.torque_limit, "velocity": joint.no_load_speed}
    Xml.SubElement(hinge, "limit", {key: _text(value) for key, value in limit.items()})
    hinge.append(Xml.Comment(f" armature: {_text(joint.armature)} kg m2 "))
    Xml.SubElement(hinge, "dynamics", damping=_text(joint.damping), friction=_text(joint.friction))


def _origin(element: Xml.Element, z: float) -> None:
    Xml.SubElement(element, "origin", xyz=f"0 0 {_text(z)}", rpy="0 0 0")


def _text(value: float) -> str:
    return repr(float(value))
