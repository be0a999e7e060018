"""Where hip, knee, rail, base and foot of a ``BodyTree`` are: by name, else by structure.

Hip and knee are two hinges with parallel axes, one the next above the other; where several pairs
are, usual names decide. The base is what the vertical slide above the hip moves.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from hopping_leg.errors import RobotError, unknown_name
from hopping_leg.robot.importing.description import BodyTree, Point, TreeJoint

HIP = re.compile(r"hip|shoulder|thigh|upper|femur", re.IGNORECASE)
KNEE = re.compile(r"knee|elbow|shank|calf|lower|tibia", re.IGNORECASE)
FOOT = re.compile(r"foot|toe|tip|(^|[_-])ee($|[_-])|end_?effector", re.IGNORECASE)
"""What parts of a leg are called."""

PARALLEL = 0.02
"""Sine of the angle up to which two directions are one."""
SAME_PLACE = 2e-3
"""Distance up to which two points are one, m."""


@dataclass(frozen=True)
class Names:
    """What the parts are called in the file; None finds them by structure and usual names."""

    base: str | None = None
    """Body that slides on the rail."""
    hip: str | None = None
    """Joint."""
    knee: str | None = None
    """Joint."""
    foot: str | None = None
    """Body, site or geom at the centre of the foot's sphere."""


@dataclass(frozen=True)
class LegParts:
    """The parts of a leg in a tree."""

    hip: TreeJoint
    knee: TreeJoint
    rail: TreeJoint | None
    base: list[int]
    """Bodies that slide, the hip's own not among them."""
    thigh: list[int]
    shank: list[int]
    foot: Point


def leg_parts(tree: BodyTree, names: Names, origin: str) -> LegParts:
    """Return the parts; messages name ``origin``.

    Raises:
        RobotError: A part is missing or ambiguous, or the leg moves in no vertical plane.
    """
    hip, knee = _hip_and_knee(tree, names, origin)
    if abs(hip.axis @ tree.up) > PARALLEL:
        raise RobotError(
            f"{origin}: the axis of '{hip.name}' is not level, so that the leg leaves its vertical"
            " plane; turn the file's root, or name another --hip."
        )
    above, thigh, shank = _lumps(tree, hip, knee)
    rail = _rail(tree, hip)
    base = _base(tree, names, above, hip, rail, origin)
    return LegParts(hip, knee, rail, base, thigh, shank, _foot(tree, names, shank, knee, origin))


def moved(tree: BodyTree, bodies: Iterable[int]) -> set[int]:
    """Return bodies and all that hang on them."""
    found = set(bodies)
    for i, body in enumerate(tree.bodies):
        if body.parent in found:
            found.add(i)
    return found


def _hip_and_knee(tree: BodyTree, names: Names, origin: str) -> tuple[TreeJoint, TreeJoint]:
    """Return the two joints: a hinge and the next one below it, with parallel axes."""
    hinges = {joint.name: joint for joint in tree.joints if joint.kind == "hinge"}
    for flag in ("hip", "knee"):
        name = getattr(names, flag)
        if name is not None and name not in hinges:
            raise RobotError(f"{origin}: --{flag}: {unknown_name('hinge', name, hinges)}")
    of_body: dict[int, list[TreeJoint]] = {}
    for joint in hinges.values():
        of_body.setdefault(joint.body, []).append(joint)
    pairs = [
        (above, knee)
        for knee in hinges.values()
        if (above := _hinge_above(tree, knee, of_body, names.hip)) is not None
        and names.knee in (None, knee.name)
        and np.linalg.norm(np.cross(above.axis, knee.axis)) < PARALLEL
    ]
    for pattern, place in ((KNEE, 1), (HIP, 0)):
        likely = [pair for pair in pairs if pattern.search(pair[place].name)]
        pairs = likely if len(pairs) > 1 and likely else pairs
    if len(pairs) == 1:
        return pairs[0]
    found = ", ".join(f"'{name}'" for name in hinges) or "none"
    what = "has no knee below a hip" if not pairs else "has several pairs that may be hip and knee"
    raise RobotError(
        f"{origin} {what} (two hinges with parallel axes, one moved by the other); its hinges are:"
        f" {found}. Name them with --hip and --knee."
    )


def _hinge_above(
    tree: BodyTree, joint: TreeJoint, of_body: dict[int, list[TreeJoint]], wanted: str | None
) -> TreeJoint | None:
    """Return the next hinge on the way to the root, or the wanted one."""
    here = of_body[joint.body]
    here, body = here[: here.index(joint)], joint.body  # a body's last joint is the innermost
    while body >= 0:
        for above in reversed(here):
            if wanted in (None, above.name):
                return above
        body = tree.bodies[body].parent
        here = of_body.get(body, [])
    return None


def _lumps(tree: BodyTree, hip: TreeJoint, knee: TreeJoint) -> tuple[list[int], ...]:
    """Return the bodies above the hip, between hip and knee, and below the knee."""
    lumps: tuple[list[int], ...] = ([], [], [])
    member: list[int] = []
    for i, body in enumerate(tree.bodies):
        lump = member[body.parent] if body.parent >= 0 else 0
        lump = 1 if i == hip.body else lump
        lump = 2 if i == knee.body else lump
        member.append(lump)
        lumps[lump].append(i)
    return lumps


def _rail(tree: BodyTree, hip: TreeJoint) -> TreeJoint | None:
    """Return the vertical slide above the hip that is nearest to it."""
    body = hip.body
    while body >= 0:
        for joint in tree.joints:
            along = abs(joint.axis @ tree.up) > 1 - PARALLEL
            if joint.body == body and joint.kind == "slide" and along:
                return joint
        body = tree.bodies[body].parent
    return None


def _base(
    tree: BodyTree,
    names: Names,
    above: list[int],
    hip: TreeJoint,
    rail: TreeJoint | None,
    origin: str,
) -> list[int]:
    """Return the bodies that slide: those below the rail, or below the named one, or all."""
    first = 0 if rail is None else rail.body
    if names.base is not None:
        carrying, body = dict[str, int](), tree.bodies[hip.body].parent
        while body >= 0:
            carrying[tree.bodies[body].name], body = body, tree.bodies[body].parent
        if names.base not in carrying:
            valid = unknown_name("body that carries the hip", names.base, carrying)
            raise RobotError(f"{origin}: --base: {valid}")
        first = carrying[names.base]
    sliding = moved(tree, [first])
    return [i for i in above if i in sliding]


def _foot(tree: BodyTree, names: Names, shank: list[int], knee: TreeJoint, origin: str) -> Point:
    """Return the foot's centre: the point of that name, else of a usual one, else a sphere."""
    points = [point for point in tree.points if point.body in shank]
    if names.foot is not None:
        named = [point for point in points if point.name == names.foot]
        if not named:
            valid = {point.name for point in points}
            said = unknown_name("point below the knee", names.foot, valid)
            raise RobotError(f"{origin}: --foot: {said}")
    else:
        named = [point for point in points if FOOT.search(point.name)]

    def far(point: Point) -> float:
        return float(np.linalg.norm(np.cross(point.position - knee.anchor, knee.axis)))

    candidates = [point for point in named or points if far(point) > SAME_PLACE]
    foot = max(candidates, key=lambda point: (point.radius is not None, far(point)), default=None)
    if foot is None:
        found = ", ".join(sorted({point.name for point in points})) or "no frames"
        raise RobotError(
            f"{origin} does not say where the foot is: below the knee stand {found}; name the"
            " centre of its sphere with --foot, or add a frame there (in URDF a link 'foot' on a"
            " fixed joint, in MJCF a site)."
        )
    return foot
