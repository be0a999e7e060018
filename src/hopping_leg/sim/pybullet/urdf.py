"""The leg's URDF as PyBullet has to read it: its reflected inertia, and no joint limits.

URDF knows no reflected inertia (armature) and PyBullet has no other place for it, so it becomes
inertia that turns as the armature does:

- The base does not turn, so the thigh turns with the hip's angle: the hip's armature adds to the
  thigh's inertia, exactly.
- The shank turns with hip and knee. A rotor on the base, geared to the knee's angle alone, carries
  the knee's armature; its mass, on the hip's axis, is taken from the base.

Both together give the closed form's mass matrix, in the air and against the ground.
"""

import dataclasses
from xml.etree import ElementTree as Xml

from hopping_leg.errors import RobotError
from hopping_leg.robot.parameters import Robot
from hopping_leg.robot.urdf import to_urdf

ROTOR = "knee_rotor"
"""Name of the rotor's link and joint."""

_ROTOR_MASS = 1e-3
"""Any small share of the base's, kg: PyBullet takes a massless link for a fixed one."""


def pybullet_urdf(robot: Robot, *, foot_collides: bool = True) -> str:
    """Return the URDF to be loaded with ``URDF_USE_INERTIA_FROM_FILE``.

    The fixed frame ``foot`` is left out (a link without inertia weighs 1 kg in PyBullet), and so
    are the joints' limits, which act in control.

    Args:
        robot: The leg.
        foot_collides: Let PyBullet find the foot's contact; the knee's and the base's it does.

    Raises:
        RobotError: The base is too light to give the rotor its mass.
    """
    if robot.base.mass <= _ROTOR_MASS:
        raise RobotError(
            f"The base of {robot.name} weighs {robot.base.mass:g} kg but must weigh more than"
            f" {_ROTOR_MASS:g} kg in PyBullet; simulate it in MuJoCo."
        )
    base = dataclasses.replace(robot.base, mass=robot.base.mass - _ROTOR_MASS)
    inertia = robot.thigh.inertia + robot.hip.armature
    thigh = dataclasses.replace(robot.thigh, inertia=inertia)
    root = Xml.fromstring(to_urdf(dataclasses.replace(robot, base=base, thigh=thigh)))
    for element in [e for e in root if e.get("name") in ("foot", "foot_tip")]:
        root.remove(element)
    for joint in root.iter("joint"):
        _free(joint)
    if not foot_collides:
        for shank in root.iterfind("link[@name='shank']"):
            shank.remove(shank.findall("collision")[-1])
    _add_rotor(root, robot.knee.armature)
    return Xml.tostring(root, encoding="unicode")


def _free(joint: Xml.Element) -> None:
    limit = joint.find("limit")
    if limit is None:
        return
    if joint.get("type") == "revolute":
        joint.set("type", "continuous")
        joint.remove(limit)
    else:
        limit.attrib.update(lower="-1000", upper="1000")


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
