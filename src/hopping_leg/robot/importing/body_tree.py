"""What a URDF or MJCF file says of a robot, in one form: bodies, joints and points in space.

Everything stands where the file's zero posture puts it, in the file's world frame, SI units.
"""

from dataclasses import dataclass, field
from typing import Literal

from hopping_leg.arrays import Array


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
    kind: Literal["hinge", "slide", "other"]
    anchor: Array
    """A point of its axis, m, (3,)."""
    axis: Array
    """Unit vector, (3,)."""
    zero: float = 0.0
    """Its coordinate in the zero posture, rad or m."""
    facts: dict[str, float] = field(default_factory=dict)
    """What the file states: lower, upper, soft_lower, soft_upper (of its coordinate), effort,
    velocity, friction, damping, armature, reduction, gear_ratio, rotor_inertia."""


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
