"""Three lumps and two joints out of a ``BodyTree``, in this package's convention.

Bodies between the moving joints rail, hip and knee are one rigid lump each; other joints are held
in the zero posture. In the leg's plane, with d down and f forward, the links at zero point along
(cos a, sin a); the package's angle of a joint is sign (u - u0) + a, with u the file's coordinate,
u0 that of the zero posture and a the thigh's direction, or the shank's against the thigh's. The
knee bends to the negative side: that decides which way is forward.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.errors import RobotError
from hopping_leg.robot.importing.description import BodyTree, TreeJoint
from hopping_leg.robot.importing.leg_parts import (
    SAME_PLACE,
    LegParts,
    Names,
    leg_parts,
    moved,
)

_ROUNDING = 1e-12  # rad
_BENT = 0.1  # rad, beyond which a range or a posture tells to which side a knee bends


@dataclass(frozen=True)
class PlanarJoint:
    """A joint in the package's convention: angle = sign (coordinate - zero) + offset."""

    name: str
    sign: int
    zero: float
    offset: float
    facts: dict[str, float]
    """As of ``TreeJoint``, limits in the package's angle."""


@dataclass(frozen=True)
class PlanarLink:
    """A lump that swings; ``inertia`` is such that the one about its upper joint is kept."""

    length: float
    mass: float
    com: float
    inertia: float
    beside: float
    """Distance of the centre of mass from the line between the joints, m, which is left out."""
    bodies: tuple[str, ...]


@dataclass(frozen=True)
class PlanarLeg:
    """A leg as a robot file can state it."""

    name: str
    base_mass: float
    base_bodies: tuple[str, ...]
    thigh: PlanarLink
    shank: PlanarLink
    hip: PlanarJoint
    knee: PlanarJoint
    foot: str
    rail: dict[str, float] = field(default_factory=dict)
    radii: dict[str, float] = field(default_factory=dict)
    """Of the spheres at base, knee_cap and foot, as far as the file has them, m."""
    ground: dict[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Plane:
    """The vertical plane that a leg moves in."""

    up: Array
    normal: Array
    """Positive turns about it swing forward."""

    def flat(self, vector: Array) -> Array:
        """Return a vector's parts (down, forward)."""
        return np.array([-vector @ self.up, vector @ np.cross(self.up, self.normal)])


def planar_leg(tree: BodyTree, names: Names, origin: str) -> PlanarLeg:
    """Return the leg that a tree holds; messages name ``origin``.

    Raises:
        RobotError: A part is missing or ambiguous, or the leg does not move in a vertical plane.
    """
    parts = leg_parts(tree, names, origin)
    hip, knee, foot = parts.hip, parts.knee, parts.foot
    plane = _plane(tree, parts)
    lines = [plane.flat(knee.anchor - hip.anchor), plane.flat(foot.position - knee.anchor)]
    for what, line in zip(("hip and knee", "knee and foot"), lines, strict=True):
        if np.linalg.norm(line) < SAME_PLACE:
            raise RobotError(
                f"{origin}: {what} lie at the same place; name others with --hip, --knee or --foot."
            )
    thigh, shank = (float(np.arctan2(line[1], line[0])) for line in lines)
    moving = moved(tree, parts.base)
    held = [j.name for j in tree.joints if j not in (hip, knee, parts.rail) and j.body in moving]
    notes = [f"Joints held in the zero posture: {', '.join(held)}."] if held else []
    return PlanarLeg(
        tree.name,
        sum(tree.bodies[i].mass for i in parts.base),
        _names(tree, parts.base),
        _link(tree, parts.thigh, hip.anchor, lines[0], plane),
        _link(tree, parts.shank, knee.anchor, lines[1], plane),
        _joint(hip, plane, thigh, (-np.pi, np.pi)),
        _joint(knee, plane, shank - thigh, (-np.pi * 1.5, np.pi / 2)),
        foot.name,
        {} if parts.rail is None else parts.rail.facts,
        _radii(tree, parts),
        tree.ground,
        (*tree.notes, *notes),
    )


def _plane(tree: BodyTree, parts: LegParts) -> Plane:
    """Return the leg's plane; of its two ways forward that to which the knee sticks out."""
    hip, knee = parts.hip, parts.knee
    level = hip.axis - (hip.axis @ tree.up) * tree.up
    plane = Plane(tree.up, level / np.linalg.norm(level))
    forward = np.cross(plane.up, plane.normal)
    if forward[np.argmax(np.abs(forward))] < 0:
        plane = Plane(plane.up, -plane.normal)
    lines = [plane.flat(knee.anchor - hip.anchor), plane.flat(parts.foot.position - knee.anchor)]
    thigh, shank = (float(np.arctan2(line[1], line[0])) for line in lines)
    bend = _wrapped(shank - thigh)
    low, high = (knee.facts.get(f"soft_{end}", knee.facts.get(end)) for end in ("lower", "upper"))
    if low is not None and high is not None and low < high < low + 2 * np.pi:
        sign = float(np.sign(knee.axis @ plane.normal))
        middle = _wrapped(sign * ((low + high) / 2 - knee.zero) + bend)
        bend = middle if abs(middle) > _BENT else bend
    return Plane(plane.up, -plane.normal) if bend > _BENT else plane


def _wrapped(angle: float) -> float:
    """Return an angle between -pi and pi."""
    return float((angle + np.pi) % (2 * np.pi) - np.pi)


def _joint(
    joint: TreeJoint, plane: Plane, direction: float, within: tuple[float, float]
) -> PlanarJoint:
    """Return a joint by the direction of its link at zero; its range lies ``within`` a turn."""
    sign = 1 if joint.axis @ plane.normal > 0 else -1
    offset, facts = _wrapped(direction), dict(joint.facts)
    offset = 0.0 if abs(offset) < _ROUNDING else offset
    for kind in ("", "soft_"):
        low, high = (facts.pop(f"{kind}{end}", None) for end in ("lower", "upper"))
        if low is None or high is None or not low < high:
            continue
        angles = sorted(sign * (end - joint.zero) + offset for end in (low, high))
        if kind == "":
            turns = -np.floor((sum(angles) / 2 - within[0]) / (2 * np.pi)) * 2 * np.pi
            offset, angles = offset + turns, [angle + turns for angle in angles]
        facts[f"{kind}lower"], facts[f"{kind}upper"] = map(float, angles)
    return PlanarJoint(joint.name, sign, joint.zero, float(offset), facts)


def _link(tree: BodyTree, lump: list[int], joint: Array, line: Array, plane: Plane) -> PlanarLink:
    """Return a lump of bodies as a link along ``line``, (down, forward), from its upper joint."""
    bodies, length = [tree.bodies[i] for i in lump], float(np.linalg.norm(line))
    masses = np.array([body.mass for body in bodies])
    coms = np.array([plane.flat(body.com - joint) for body in bodies])
    mass = float(masses.sum())
    com = masses @ coms / mass if mass > 0 else np.zeros(2)
    inertia = sum(float(plane.normal @ body.inertia @ plane.normal) for body in bodies)
    inertia += float(masses @ np.sum((coms - com) ** 2, axis=1))
    along, beside = (float(com @ at) / length for at in (line, np.array([-line[1], line[0]])))
    inertia += mass * beside**2
    return PlanarLink(length, mass, along, inertia, beside, _names(tree, lump))


def _names(tree: BodyTree, lump: Iterable[int]) -> tuple[str, ...]:
    return tuple(tree.bodies[i].name for i in lump if tree.bodies[i].mass > 0)


def _radii(tree: BodyTree, parts: LegParts) -> dict[str, float]:
    """Return the radii of the spheres around hip, knee and foot."""
    places = {
        "base": (parts.base, parts.hip.anchor),
        "knee_cap": ([*parts.thigh, *parts.shank], parts.knee.anchor),
        "foot": (parts.shank, parts.foot.position),
    }
    radii: dict[str, float] = {}
    for name, (bodies, place) in places.items():
        for point in tree.points:
            aside = np.cross(point.position - place, parts.hip.axis)
            if point.radius and point.body in bodies and np.linalg.norm(aside) < SAME_PLACE:
                radii.setdefault(name, point.radius)
    return radii
