"""The recipes by name."""

import dataclasses
import math
from collections.abc import Sequence
from typing import Any, Literal

from hopping_leg.errors import UsageError, unknown_name
from hopping_leg.rl.recipe import Recipe
from hopping_leg.rl.recipes.adaptive import AdaptiveRecipe
from hopping_leg.rl.recipes.fast import FastRecipe
from hopping_leg.rl.recipes.paper import PaperRecipe
from hopping_leg.rl.recipes.precise import PreciseRecipe
from hopping_leg.rl.recipes.recurrent import RecurrentRecipe
from hopping_leg.sim.randomization import IDENTIFIABLE_RANGES, WIDE_RANGES, Range

RECIPES: dict[str, type[Recipe]] = {
    recipe.name: recipe
    for recipe in (FastRecipe, PaperRecipe, PreciseRecipe, AdaptiveRecipe, RecurrentRecipe)
}
"""Every recipe that ``hop train`` knows."""


Randomise = Literal["none", "twins", "surprises"]
"""Ranges from which each leg in training draws its own numbers."""

_RANGES: dict[Randomise, tuple[Range, ...]] = {
    "none": (),
    "twins": IDENTIFIABLE_RANGES,
    "surprises": WIDE_RANGES,
}

_OF_TASK = ("command_skew", "fall_penalty")
"""Numbers of a task that can be changed like those of a recipe's other parts."""

_SWITCH = {"true": True, "1": True, "false": False, "0": False}
_KINDS = {bool: "true or false", int: "a whole number", float: "a number"}


def get_recipe(name: str) -> Recipe:
    """Return a recipe with its defaults.

    Raises:
        UsageError: There is no such recipe.
    """
    if name not in RECIPES:
        raise UsageError(unknown_name("recipe", name, RECIPES))
    return RECIPES[name]()


def change(recipe: Recipe, changes: Sequence[str]) -> Recipe:
    """Return a recipe with some of its numbers changed.

    Args:
        recipe: The defaults.
        changes: Each ``name=number``, or ``part.name=number`` for a number of its reward, say.

    Raises:
        UsageError: The recipe has no such number, or the value is none.
    """
    numbers = numbers_of(recipe)
    values: dict[str, Any] = {}
    for entry in changes:
        name, _, text = entry.partition("=")
        if name not in numbers:
            raise UsageError(unknown_name(f"number of recipe '{recipe.name}'", name, numbers))
        kind = type(numbers[name])
        try:
            value = _SWITCH[text.lower()] if kind is bool else kind(text)
        except (ValueError, KeyError):
            value = math.nan
        if not math.isfinite(value):
            raise UsageError(
                f"'{entry}' does not say {_KINDS[kind]}; give e.g. {name}={numbers[name]}."
            )
        values[name] = value
    for name in [name for name in values if "." in name]:
        part, _, number = name.partition(".")
        values[part] = dataclasses.replace(
            values.get(part, getattr(recipe, part)), **{number: values.pop(name)}
        )
    return dataclasses.replace(recipe, **values)


def randomise(recipe: Recipe, ranges: Randomise) -> Recipe:
    """Return the recipe on legs that each draw their own numbers from ranges."""
    return dataclasses.replace(
        recipe, task=dataclasses.replace(recipe.task, randomised=_RANGES[ranges])
    )


def randomised_by(options: dict[str, Any]) -> Randomise | None:
    """Return from which ranges the legs of a run drew their numbers, None if from a user's own.

    Args:
        options: As in a run's ``config.json``.
    """
    stored = [[s["path"], s["low"], s["high"]] for s in options["task"]["randomised"]]
    for name, drawn in _RANGES.items():
        if stored == [[s.path, s.low, s.high] for s in drawn]:
            return name
    return None


def recipe_of(name: str, options: dict[str, Any]) -> Recipe:
    """Return the recipe that a run was asked for, the inverse of ``words_of``.

    Args:
        name: Of the recipe.
        options: As in the run's ``config.json``.

    Raises:
        UsageError: There is no such recipe.
    """
    recipe = change(get_recipe(name), changes_of(name, options))
    ranges, seen = randomised_by(options), options["task"]["observation"]
    if ranges is not None:
        recipe = randomise(recipe, ranges)
    task = dataclasses.replace(recipe.task, observation=seen)
    heights = options.get("heights")
    return dataclasses.replace(recipe, task=task, heights=tuple(heights) if heights else None)


def numbers_of(recipe: Recipe) -> dict[str, int | float]:
    """Return a recipe's plain numbers by name.

    Of its task's, most go with the robot's size or have options of their own.
    """
    found: dict[str, int | float] = {}
    for field in dataclasses.fields(recipe):
        value = getattr(recipe, field.name)
        if isinstance(value, int | float):
            found[field.name] = value
        elif dataclasses.is_dataclass(value):
            inner = {
                f"{field.name}.{f.name}": getattr(value, f.name)
                for f in dataclasses.fields(value)
                if field.name != "task" or f.name in _OF_TASK
            }
            found |= {name: v for name, v in inner.items() if isinstance(v, int | float)}
    return found


def changes_of(recipe: str, options: dict[str, Any]) -> list[str]:
    """Return the ``name=number`` entries in which stored options differ from a recipe's defaults.

    Args:
        recipe: Name of the recipe.
        options: As in a run's ``config.json``.
    """
    if recipe not in RECIPES:
        return []
    usual = RECIPES[recipe]()
    defaults = numbers_of(usual)
    stored = {name: _stored(options, usual, name) for name in defaults}
    return [f"{name}={value}" for name, value in stored.items() if value != defaults[name]]


def _stored(options: dict[str, Any], usual: Recipe, name: str) -> float:
    """Return a number of stored options.

    A run from before it existed has that of its part without a recipe, which changes nothing.
    """
    part, _, number = name.rpartition(".")
    inner = type(getattr(usual, part))() if part else usual
    value: float = (options.get(part, {}) if part else options).get(number, getattr(inner, number))
    return value


def words_of(recipe: str, options: dict[str, Any]) -> list[str]:
    """Return the options of ``hop train`` that make a recipe of its defaults.

    Args:
        recipe: Name of the recipe; one that is not known here has no defaults.
        options: As in a run's ``config.json``.
    """
    if recipe not in RECIPES:
        return []
    usual, words = dataclasses.asdict(RECIPES[recipe]()), list[str]()
    ranges, seen = randomised_by(options), options["task"]["observation"]
    if ranges not in (None, randomised_by(usual)):
        words += ["--randomise", ranges]
    if seen != usual["task"]["observation"]:
        words += ["--observation", seen]
    if options.get("heights"):
        words += ["--heights", *map(str, options["heights"])]
    changes = changes_of(recipe, options)
    return [*words, "--set", *changes] if changes else words
