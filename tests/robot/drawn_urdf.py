"""URDFs of drawn legs as somebody else might have written them."""

from dataclasses import dataclass
from xml.etree import ElementTree as Xml

import numpy as np

from hopping_leg.robot import Robot


@dataclass(frozen=True)
class Conventions:
    """How a file describes a leg whose own convention is this package's."""

    zero: tuple[float, float]
    """Package's angles of hip and knee in the file's zero posture."""
    axes: tuple[int, int]
    """Whether each joint turns as here, 1, or against it, -1."""
    yaw: float
    """Of the leg's plane in the file's world."""
    frames: tuple[np.ndarray, ...]
    """Rotation of each body's frame, (3, 3)."""
    aside: tuple[float, float, float]
    """Of hip, knee and foot along the joints' axis, m."""


def draw(rng: np.random.Generator) -> Conventions:
    """Return conventions of a file."""
    frames = tuple(np.linalg.qr(rng.normal(size=(3, 3)))[0] for _ in range(3))
    return Conventions(
        (rng.uniform(-2, 2), rng.uniform(-2.5, -0.2)),
        tuple(rng.choice([-1, 1], 2)),
        rng.uniform(-np.pi, np.pi),
        tuple(frame * np.sign(np.linalg.det(frame)) for frame in frames),
        tuple(rng.uniform(-0.1, 0.1, 3)),
    )


def urdf(robot: Robot, how: Conventions) -> str:
    """Return a robot in a file's conventions, each link in two parts beside the leg's plane."""
    root = Xml.Element("robot", name="drawn")
    turn = _about((0, 0, 1), how.yaw)
    normal, down = turn @ [0, -1, 0], np.array([0.0, 0, -1])
    angles = (how.zero[0], sum(how.zero))
    along = [_about(normal, angle) @ down for angle in angles]
    hip = how.aside[0] * normal
    knee = hip + robot.thigh.length * along[0] + how.aside[1] * normal
    foot = knee + robot.shank.length * along[1] + how.aside[2] * normal
    Xml.SubElement(root, "link", name="stand")
    base, thigh, shank = (np.zeros(3), how.frames[0]), (hip, how.frames[1]), (knee, how.frames[2])
    _joint(root, "slide", "prismatic", "stand", "base", (np.zeros(3), np.eye(3)), base, (0, 0, 1))
    _link(root, "base", base, robot.base.mass, np.zeros(3), np.eye(3) * 1e-3, normal)
    for name, parts, pose, link, direction, at in (
        ("thigh", (base, "base"), thigh, robot.thigh, along[0], hip),
        ("shank", (thigh, "thigh"), shank, robot.shank, along[1], knee),
    ):
        joint, sign, zero = (
            (robot.hip, how.axes[0], how.zero[0])
            if name == "thigh"
            else (robot.knee, how.axes[1], how.zero[1])
        )
        element = _joint(
            root, f"{name}_joint", "revolute", parts[1], name, parts[0], pose, sign * normal
        )
        ends = sorted(sign * (stop - zero) for stop in (joint.stop_lower, joint.stop_upper))
        facts = {
            "limit": {"lower": ends[0], "upper": ends[1], "effort": 20.0, "velocity": 30.0},
            "dynamics": {"friction": joint.friction, "damping": joint.damping},
        }
        for tag, values in facts.items():
            Xml.SubElement(element, tag, {key: _text([value]) for key, value in values.items()})
        tensor = link.inertia * (np.eye(3) + np.outer(direction, direction) * -0.9)
        _link(root, name, pose, link.mass, at + link.com * direction, tensor, normal)
    tip = (foot, np.eye(3))
    _joint(root, "end", "fixed", "shank", "toe", shank, tip, (1, 0, 0))
    Xml.SubElement(root, "link", name="toe")
    return Xml.tostring(root, encoding="unicode")


def _link(root, name, pose, mass, com, tensor, normal):
    """Add a body as two halves whose masses lie apart, across the plane and along the link."""
    spread = 0.3 * np.sqrt(tensor[0, 0] / mass) * (normal + pose[1][:, 0] * 0.5)
    own = tensor - mass * (spread @ spread * np.eye(3) - np.outer(spread, spread))
    for suffix, side in (("", 1), ("_rest", -1)):
        element = Xml.SubElement(root, "link", name=f"{name}{suffix}")
        inertial = Xml.SubElement(element, "inertial")
        half = pose if not suffix else (com - spread, np.eye(3))
        place = half[1].T @ (com + side * spread - half[0])
        Xml.SubElement(inertial, "origin", xyz=_text(place), rpy="0 0 0")
        Xml.SubElement(inertial, "mass", value=_text([mass / 2]))
        matrix = half[1].T @ (own / 2) @ half[1]
        entries = {"ixx": (0, 0), "iyy": (1, 1), "izz": (2, 2)}
        entries |= {"ixy": (0, 1), "ixz": (0, 2), "iyz": (1, 2)}
        values = {key: _text([matrix[at]]) for key, at in entries.items()}
        Xml.SubElement(inertial, "inertia", values)
    weld = (com - spread, np.eye(3))
    _joint(root, f"{name}_weld", "fixed", name, f"{name}_rest", pose, weld, (1, 0, 0))


def _joint(root, name, kind, parent, child, above, below, axis):
    """Add a joint between poses in the world; its axis is in the world, too."""
    joint = Xml.SubElement(root, "joint", name=name, type=kind)
    Xml.SubElement(joint, "parent", link=parent)
    Xml.SubElement(joint, "child", link=child)
    turn = above[1].T @ below[1]
    rpy = (
        np.arctan2(turn[2, 1], turn[2, 2]),
        np.arctan2(-turn[2, 0], np.hypot(turn[2, 1], turn[2, 2])),
        np.arctan2(turn[1, 0], turn[0, 0]),
    )
    Xml.SubElement(joint, "origin", xyz=_text(above[1].T @ (below[0] - above[0])), rpy=_text(rpy))
    Xml.SubElement(joint, "axis", xyz=_text(below[1].T @ np.asarray(axis, float) * 3))
    return joint


def _about(axis, angle):
    """Return the rotation about a unit vector (Rodrigues)."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def _text(values):
    return " ".join(repr(float(value)) for value in values)
