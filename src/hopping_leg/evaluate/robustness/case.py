"""What one leg of the benchmark meets, and the numbers of a robot that an axis changes."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import reduce
from operator import attrgetter

from hopping_leg.io import replace_at
from hopping_leg.robot.parameters import Robot


@dataclass(frozen=True)
class Case:
    """One world; its controller knows the robot alone, as it was before the case changed it."""

    robot: Robot
    """What is simulated."""
    torque_noise: float = 0.0
    """Standard deviation of the white noise added to each joint's torque, N m."""
    push: float = 0.0
    """Impulse of each push on the base, N s."""
    ground: float = 0.0
    """Height of the ground's steps, m."""
    command_step: float = 0.0
    """Height of the command's steps, m."""


def with_numbers(robot: Robot, numbers: Mapping[str, float]) -> Robot:
    """Return a robot with other numbers.

    Args:
        robot: What stays otherwise.
        numbers: Dotted path, e.g. ``"rail.friction"``, to value.
    """
    for path, value in numbers.items():
        robot = replace_at(robot, path, value)
    return robot


def times(robot: Robot, factor: float, *paths: str) -> Robot:
    """Return a robot with the numbers at some dotted paths multiplied."""
    return with_numbers(robot, {path: factor * attrgetter(path)(robot) for path in paths})


def of_both_joints(robot: Robot, path: str, value: float) -> Robot:
    """Return a robot with a number of both joints' drives set.

    Args:
        robot: What stays otherwise.
        path: Dotted path below ``reality.hip`` and ``reality.knee``.
        value: The number.
    """
    return reduce(
        lambda one, joint: with_numbers(one, {f"reality.{joint}.{path}": value}),
        ("hip", "knee"),
        robot,
    )
