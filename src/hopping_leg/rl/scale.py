"""Fit a recipe to a leg of another size."""

import dataclasses
from typing import TypeVar

import numpy as np

from hopping_leg.envs import TaskConfig
from hopping_leg.rl.recipe import Recipe
from hopping_leg.robot.parameters import Robot

HEIGHT = 0.30
"""Straight height of the leg that the recipes' lengths are meant for, m."""

WEIGHT_MOMENT = 0.548
"""Its moving mass times its straight height, kg m: what hop torques grow with."""

R = TypeVar("R", bound=Recipe)


def fit(recipe: R, robot: Robot) -> R:
    """Return the recipe with heights, lengths and torques scaled to a robot.

    Heights and lengths grow with the straight leg, rounded to 5 mm; torques with mass times length,
    rounded to 0.5 N m and within the motors' limit. A leg of the paper's height keeps the recipe.
    Heights that the recipe gives as they are stay so; trials lie in their inner four fifths.

    Raises:
        UsageError: Those heights are no range of heights.
    """
    return _take_heights(_grow(recipe, robot))


def _take_heights(recipe: R) -> R:
    if recipe.heights is None:
        return recipe
    task = dataclasses.replace(recipe.task, command_range=recipe.heights)
    low, high = task.command_bounds
    edge = 0.1 * (high - low)
    judged = np.linspace(low + edge, high - edge, len(recipe.eval_commands))
    heights = tuple(float(_round(height)) for height in judged)
    return dataclasses.replace(recipe, task=task, eval_commands=heights)


def _grow(recipe: R, robot: Robot) -> R:
    ratio = robot.straight_height / HEIGHT
    if abs(ratio - 1) < 0.01:
        return recipe
    task = recipe.task
    low, high = task.command_range or (0.0, 0.0)
    moment = robot.mass * robot.straight_height / WEIGHT_MOMENT
    limit = robot.of_joints("torque_limit")
    hip, knee = (
        min(_round(torque * moment, 0.5), float(most))
        for torque, most in zip(task.action_torque, limit, strict=True)
    )
    fitted: TaskConfig = dataclasses.replace(
        task,
        commands=tuple(_round(c * ratio) for c in task.commands),
        command_range=task.command_range and (_round(low * ratio), _round(high * ratio)),
        start_length=_round(task.start_length * ratio),
        drop_length=(_round(task.drop_length[0] * ratio), _round(task.drop_length[1] * ratio)),
        action_torque=(hip, knee),
    )
    heights = tuple(_round(c * ratio) for c in recipe.eval_commands)
    return dataclasses.replace(recipe, task=fitted, eval_commands=heights)


def _round(value: float, step: float = 0.005) -> float:
    return round(round(value / step) * step, 6)
