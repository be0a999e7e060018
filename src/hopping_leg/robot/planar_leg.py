"""The planar leg in a URDF or MJCF file, in this package's convention.

Hip and knee are two hinges with parallel axes, one the next above the other; where several pairs
are, usual names decide. The base is what the vertical slide above the hip moves. Bodies between
these joints are one rigid lump each; other joints are held in the zero posture.

In the leg's plane, with d down and f forward, the links at zero point along (cos a, sin a); the
package's angle of a joint is sign (u - u0) + a, with u the file's coordinate, u0 that of the zero
posture and a the thigh's direction, or the shank's against the thigh's. The knee bends to the
negative side: that decides which way is forward.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.errors import RobotError, unknown_name
from hopping_leg.robot.description import Description, Point

Entry = tuple[float, str]
"""A number and its source."""

_HIP = re.compile(r"hip|shoulder|thigh|upper|femur", re.IGNORECASE)
_KNEE = re.compile(r"knee|elbow|shank|calf|lower|tibia", re.IGNORECASE)
_FOOT = re.compile(r"foot|toe|tip|(^|[_-])ee($|[_-])|end_?effector", re.IGNORECASE)

_HINGE, _SLIDE = mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE
_TURN = 2 * np.pi
_PARALLEL = 0.02  # sine of the angle up to which two directions are one
_SAME_PLACE = 2e-3  # m, up to which two points are one
_THROUGH = "where the line from the knee through the shank's centre of mass ends"
_BENT = 0.1  # rad, beyond which a range or a posture tells to which side a knee bends


@dataclass(frozen=True)
class PlanarLeg:
    """What a file says of a leg."""

    name: str
    numbers: dict[str, Entry]
    """By their path in a robot file, and ``hip.effort``, N m, ``hip.velocity``, rad/s, and the
    knee's, at the joint; as far as the file states them."""
    notes: list[str]
    """Lines on hip's and knee's angle by the file's coordinates, and on what is not read."""
    doubts: list[str]
    """Sentences on what the file hardly means."""


class NoFootError(RobotError):
    """A file does not say where the foot is; its distance from the knee would."""


def read_leg(
    path: Path, hip: str | None = None, knee: str | None = None,
    foot: str | None = None, shank_length: float | None = None,
) -> PlanarLeg:  # fmt: skip
    """Return the leg that a URDF or MJCF file describes.

    Hip and knee are the file's names of joints, the foot that of the body, site or geom at the
    centre of its sphere; by default they are found by structure and usual names. A foot of no name
    lies ``shank_length``, m, from the knee, through the shank's centre of mass.

    RobotError says that the file cannot be read, that a part is missing or ambiguous, or that the
    leg moves in no vertical plane; NoFootError that the foot is missing.
    """
    tree = Description(path)
    data, body_of = tree.data, tree.model.jnt_bodyid
    upper, lower = joints = _hip_and_knee(tree, hip, knee)
    rails = (i for i in tree.above(upper, _SLIDE) if abs(data.xaxis[i] @ tree.up) > 1 - _PARALLEL)
    rail = next(rails, None)
    moving = tree.subtree(0 if rail is None else body_of[rail])
    leg, shank = (tree.subtree(body_of[joint]) for joint in joints)
    tip = _foot(tree, foot, shank, lower, shank_length)
    ends = np.stack([data.xanchor[upper], data.xanchor[lower], tip.position])
    normal, flat, told = _plane(tree, joints, ends)
    lines = np.diff(ends, axis=0) @ flat.T
    thigh, direction = np.arctan2(lines[:, 1], lines[:, 0])
    found = {"rail": {} if rail is None else _stated(tree, rail), "base": {}}
    found["hip"], hip_angle = _joint(tree, upper, normal, thigh, -np.pi)
    found["knee"], knee_angle = _joint(tree, lower, normal, direction - thigh, -1.5 * np.pi)
    if base := tree.heavy(moving - leg):
        mass, said = tree.model.body_mass[base].sum(), " + ".join(map(tree.body, base))
        found["base"]["mass"] = float(mass), said
    below = (tree.joint(lower), f"'{tip.name}'")
    for i, (name, lump) in enumerate((("thigh", leg - shank), ("shank", shank))):
        length = float(np.linalg.norm(lines[i])), f"{tree.joint(joints[i])} to {below[i]}"
        found[name] = {"length": length, **_link(tree, lump, ends[i], lines[i], normal, flat)}
    for point in tree.points(shank):
        if point.radius > 0 and _aside(tree, upper, point.position - tip.position) < _SAME_PLACE:
            found.setdefault("foot", {"radius": (point.radius, f"sphere of {point.name}")})
    hinges = (i for i in range(tree.model.njnt) if body_of[i] in moving)
    held = ", ".join(tree.joint(i) for i in hinges if i not in (*joints, rail))
    notes = [f"  hip = {hip_angle}", f"  knee = {knee_angle}"]
    notes += [] if told else ["The knee's side is a guess: both signs may be the other ones."]
    notes += ["No vertical slide: the base is all but the leg."] if rail is None else []
    notes += [f"The foot is {tip.name}."] if tip.name == _THROUGH else []
    notes += [f"{tree.loops} equality constraints are left out."] if tree.loops else []
    notes += [f"Joints held in the zero posture: {held}."] if held else []
    numbers = {
        f"{part}.{key}": (value, f"{path.name}, {source}")
        for part, entries in found.items()
        for key, (value, source) in entries.items()
        if value > 0 or "stop" in key
    }
    doubts = [f"'{tree.body(i)}' weighs nothing." for i in sorted(tree.weightless & moving - {0})]
    for i, (low, high) in zip(joints, tree.model.jnt_range[[upper, lower]], strict=True):
        odd = "in degrees?" if max(-low, high) > _TURN else "taken in order." if low > high else ""
        doubts += [f"'{tree.joint(i)}' ends at {low:g} and {high:g} rad: {odd}"] if odd else []
    return PlanarLeg(tree.name, numbers, notes, [f"{tree.origin}: {doubt}" for doubt in doubts])


def _named(tree: Description, option: str, kind: str, name: str, valid: Iterable[str]) -> str:
    """Return a name that the user gave; RobotError where it is none of the valid ones."""
    if name not in valid:
        raise RobotError(f"{tree.origin}: --{option}: {unknown_name(kind, name, valid)}")
    return name


def _hip_and_knee(tree: Description, hip: str | None, knee: str | None) -> tuple[int, int]:
    """Return the two joints: a hinge and the next one below it, with parallel, level axes."""
    joints, axis, place = range(tree.model.njnt), tree.data.xaxis, tree.data.xanchor
    hinges = {tree.joint(i): i for i in joints if tree.model.jnt_type[i] == _HINGE}
    uppers, lowers = (
        hinges.values() if name is None else [hinges[_named(tree, option, "hinge", name, hinges)]]
        for option, name in (("hip", hip), ("knee", knee))
    )
    pairs = []
    for lower in lowers:
        upper = next((i for i in tree.above(lower, _HINGE) if i in uppers), None)
        if upper is not None and np.linalg.norm(np.cross(axis[upper], axis[lower])) < _PARALLEL:
            pairs.append((upper, lower))
    for pattern, which in ((_KNEE, 1), (_HIP, 0)):
        likely = [pair for pair in pairs if pattern.search(tree.joint(pair[which]))]
        pairs = likely if len(pairs) > 1 and likely else pairs
    if len(pairs) != 1:
        found = ", ".join(f"'{name}'" for name in hinges) or "none"
        what = "has several pairs that may be hip and knee" if pairs else "has no knee below a hip"
        raise RobotError(
            f"{tree.origin} {what} (two hinges with parallel axes, one moved by the other); its"
            f" hinges are: {found}. Name them with --hip and --knee."
        )
    (pair,) = pairs
    both = " and ".join(f"'{tree.joint(i)}'" for i in pair)
    if abs(axis[pair[0]] @ tree.up) > _PARALLEL:
        raise RobotError(
            f"{tree.origin}: the axes of {both} are not level, so that the leg leaves its vertical"
            " plane; turn the file's root, or name other joints, --hip or --knee."
        )
    if _aside(tree, pair[0], place[pair[1]] - place[pair[0]]) < _SAME_PLACE:
        raise RobotError(
            f"{tree.origin}: {both} turn about one axis; name others, --hip or --knee."
        )
    return pair


def _foot(
    tree: Description, name: str | None, shank: set[int], knee: int, length: float | None
) -> Point:
    """Return its centre: the point of a name, else a usual one, a sphere, one at the length."""
    points = tree.points(shank)
    likely = [point for point in points if _FOOT.search(point.name)] or points
    if name is not None:
        _named(tree, "foot", "point below the knee", name, [point.name for point in points])
        likely = [point for point in points if point.name == name]

    def far(point: Point) -> float:
        return _aside(tree, knee, point.position - tree.data.xanchor[knee])

    candidates = [point for point in likely if far(point) > _SAME_PLACE]
    foot = max(candidates, key=lambda point: (point.radius > 0, far(point)), default=None)
    if foot is not None:
        return foot
    knees, axis, bodies = tree.data.xanchor[knee], tree.data.xaxis[knee], tree.heavy(shank)
    masses = tree.model.body_mass[bodies]
    line = masses @ (tree.data.xipos[bodies] - knees) / max(masses.sum(), 1e-9)
    line -= (line @ axis) * axis
    com = float(np.linalg.norm(line))
    if length and com > _SAME_PLACE:
        return Point(_THROUGH, knees + length / com * line, 0.0)
    found = ", ".join(sorted({point.name for point in points}))
    raise NoFootError(
        f"{tree.origin} does not say where the foot is: on the knee's axis stand {found}, below it"
        f" only the shank's centre of mass, {com:.3g} m away; give the foot's distance through it,"
        " e.g. --set shank.length=0.2, or add a frame at its centre and name it with --foot."
    )


def _aside(tree: Description, joint: int, vector: Array) -> float:
    """Return a vector's length across a joint's axis."""
    return float(np.linalg.norm(np.cross(vector, tree.data.xaxis[joint])))


def _plane(tree: Description, joints: tuple[int, int], ends: Array) -> tuple[Array, Array, bool]:
    """Return the axis about which positive turns swing forward, and down and forward as rows.

    Of the two ways forward it is that to which the knee sticks out; last, whether the file tells.
    """
    axis = tree.data.xaxis[joints[0]]
    level = axis - (axis @ tree.up) * tree.up
    normal = level / np.linalg.norm(level)
    forward = np.cross(tree.up, normal)
    if forward[np.argmax(np.abs(forward))] < 0:
        normal, forward = -normal, -forward
    lines = np.diff(ends, axis=0)
    thigh, shank = np.arctan2(lines @ forward, -lines @ tree.up)
    bend = _wrapped(shank - thigh)
    stops = _stops(tree, joints[1])
    if stops is not None and stops[1] < stops[0] + _TURN:
        sign = float(np.sign(tree.data.xaxis[joints[1]] @ normal))
        middle = _wrapped(sign * sum(stops) / 2 + bend)
        bend = middle if abs(middle) > _BENT else bend
    if bend > _BENT:
        normal, forward = -normal, -forward
    return normal, np.stack([-tree.up, forward]), abs(bend) > _BENT


def _wrapped(angle: float) -> float:
    """Return an angle between -pi and pi."""
    return float((angle + np.pi) % _TURN - np.pi)


def _stops(tree: Description, joint: int) -> tuple[float, float] | None:
    """Return where a joint ends against the zero posture, rad, None if nowhere within a turn."""
    ends = tree.model.jnt_range[joint]
    low, high = np.sort(ends) - tree.zero(joint)
    limited = (tree.model.jnt_limited[joint] or ends[0] > ends[1]) and -_TURN <= low < high <= _TURN
    return (float(low), float(high)) if limited else None


def _stated(tree: Description, joint: int) -> dict[str, Entry]:
    """Return what is stated of a joint but its stops."""
    return {key: (v, f"joint {tree.joint(joint)}, {key}") for key, v in tree.numbers(joint).items()}


def _joint(
    tree: Description, joint: int, normal: Array, direction: float, least: float
) -> tuple[dict[str, Entry], str]:
    """Return what is stated of a joint, and the package's angle by the file's coordinate.

    The middle between the stops lies within a turn from ``least``.
    """
    sign = 1 if tree.data.xaxis[joint] @ normal > 0 else -1
    name, zero, offset = tree.joint(joint), tree.zero(joint), round(_wrapped(direction), 12)
    entries = _stated(tree, joint)
    if (stops := _stops(tree, joint)) is not None:
        offset -= _TURN * float(np.floor((sign * sum(stops) / 2 + offset - least) / _TURN))
        ends = sorted(sign * end + offset for end in stops)
        for key, end in zip(("stop_lower", "stop_upper"), ends, strict=True):
            entries[key] = end, f"joint {name}"
    coordinate = f"({name} - {zero:.6g})" if zero else name
    added = f" {'-' if offset < 0 else '+'} {abs(offset):.6g} rad" if offset else ""
    return entries, f"{'' if sign > 0 else '-'}{coordinate}{added}"


def _link(
    tree: Description, lump: set[int], joint: Array, line: Array, normal: Array, flat: Array
) -> dict[str, Entry]:
    """Return mass, com and inertia of bodies as a link along ``line`` from its upper joint.

    The inertia is such that the one about the joint is kept.
    """
    model, data, bodies = tree.model, tree.data, tree.heavy(lump)
    if not bodies:
        return {}
    masses, coms = model.body_mass[bodies], (data.xipos[bodies] - joint) @ flat.T
    mass = float(masses.sum())
    com = masses @ coms / mass
    across = np.einsum("bij,i->bj", data.ximat[bodies].reshape(-1, 3, 3), normal)
    own = float(np.sum(model.body_inertia[bodies] * across**2))
    own += float(masses @ np.sum((coms - com) ** 2, axis=1))
    length, across_line = np.linalg.norm(line), np.array([-line[1], line[0]])
    along, beside = float(com @ line / length), float(com @ across_line / length)
    said = " + ".join(map(tree.body, bodies))
    left = f"; {1e3 * abs(beside):.2g} mm beside the line are left out"
    return {
        "mass": (mass, said),
        "com": (along, f"{said}, along the link{left if abs(beside) > 1e-6 else ''}"),
        "inertia": (own + mass * beside**2, f"{said}, about the centre of mass"),
    }
