"""Legs that differ: the same robot with numbers drawn anew for each, for domain randomisation.

The paper fits one simulation to the robot and rejects the alternative, training on many; this is
that alternative. Controllers and rewards go on believing the robot itself, so only what the physics
alone reads may vary: sizes, motors' speeds and joint limits may not.
"""

import dataclasses
from collections.abc import Sequence
from operator import attrgetter
from typing import Any, TypeVar

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.errors import UsageError, unknown_name
from hopping_leg.robot.fields import check_physics
from hopping_leg.robot.parameters import Robot
from hopping_leg.sim.twins import Range

VARIABLE = (
    "base.mass",
    "rail.friction",
    "rail.damping",
    *(f"{link}.{name}" for link in ("thigh", "shank") for name in ("mass", "com", "inertia")),
    *(f"contact.{name}" for name in ("time_constant", "damping_ratio", "friction")),
    *(
        f"{joint}.{name}"
        for joint in ("hip", "knee")
        for name in ("friction", "damping", "armature", "load_friction", "torque_gain")
    ),
    "reality.latency.command",
)
"""Numbers of a robot that may differ from leg to leg; the latency by whole control periods."""


def _times(path: str, low: float, high: float) -> Range:
    return Range(path, "1", low, high, "[C]", "logarithmic", "factors")


def _both(name: str, unit: str, low: float, high: float) -> tuple[Range, ...]:
    return tuple(Range(f"{joint}.{name}", unit, low, high, "[C]") for joint in ("hip", "knee"))


SURPRISES = (
    _times("base.mass", 0.7, 1.6),
    *(_times(f"{link}.{n}", 0.6, 2.0) for link in ("thigh", "shank") for n in ("mass", "inertia")),
    _times("rail.friction", 0.3, 6.0),
    _times("rail.damping", 0.3, 6.0),
    _times("contact.time_constant", 0.22, 2.8),
    _times("contact.damping_ratio", 0.4, 2.5),
    _times("hip.torque_gain", 1 / 1.3, 1.3),
    _times("knee.torque_gain", 1 / 1.3, 1.3),
    *_both("friction", "N m", 0.0, 1.4),
    Range("reality.latency.command", "s", 0.0, 0.0149, "[C]", bounds="additions", step=5e-3),
)
"""What may surprise any leg: a payload, heavy links, a worn or dry rail, hard and soft ground,
motors that give less or more than they should, joints that rub, commands that come later."""

Part = TypeVar("Part")


def vary(
    robot: Robot,
    ranges: Sequence[Range],
    count: int,
    rng: np.random.Generator,
    chance: float = 1.0,
) -> tuple[Robot, ...]:
    """Return a robot as often as asked for, each with its own numbers.

    Args:
        robot: What is not drawn.
        ranges: What is drawn, in this order, leg by leg.
        count: How many.
        rng: Source of randomness.
        chance: That a number is drawn rather than the robot's own.

    Raises:
        UsageError: A range's number may not differ from leg to leg.
        RobotError: A drawn number contradicts the robot.
    """
    for spread in ranges:
        if spread.path not in VARIABLE:
            raise UsageError(unknown_name("number that may vary", spread.path, VARIABLE))
    variants = []
    for number in range(count):
        variant = robot
        for spread in ranges:
            value = spread.draw(rng, attrgetter(spread.path)(robot))
            if chance == 1 or rng.random() < chance:
                variant = with_value(variant, spread.path.split("."), value)
        check_physics(variant, f"variant {number} of {robot.name}")
        variants.append(variant)
    return tuple(variants)


def places(robot: Robot, variants: Sequence[Robot], ranges: Sequence[Range]) -> Array:
    """Return where the numbers of a robot's variants lie in their ranges, -1 to 1, (n, ranges)."""
    found = np.empty((len(variants), len(ranges)))
    for column, spread in enumerate(ranges):
        number = attrgetter(spread.path)
        found[:, column] = [spread.place(number(v), number(robot)) for v in variants]
    return found


def with_value(part: Part, path: list[str], value: float) -> Part:
    """Return a nested dataclass with the entry at a path replaced."""
    name, *rest = path
    entry: Any = with_value(getattr(part, name), rest, value) if rest else value
    return dataclasses.replace(part, **{name: entry})  # type: ignore[type-var]
