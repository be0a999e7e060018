"""The recipes by name, and how the command line changes their options."""

import math
from collections.abc import Mapping, Sequence
from operator import attrgetter
from typing import Any, Literal, get_args, get_type_hints

import msgspec

from hopping_leg.controllers.user_controllers import find_user_object
from hopping_leg.errors import UsageError, unknown_name
from hopping_leg.rl.recipe import Recipe
from hopping_leg.rl.recipes import fast, paper, rl, universal
from hopping_leg.rl.students import StudentConfig
from hopping_leg.sim.randomization import IDENTIFIABLE_RANGES, WIDE_RANGES, Range

_ALL = (rl.RL, fast.FAST, paper.PAPER, universal.UNIVERSAL, universal.SMALL)

RECIPES: Mapping[str, Recipe] = {recipe.name: recipe for recipe in _ALL}
"""Every recipe that ``hop train`` knows."""

Randomise = Literal["none", "twins", "surprises"]
"""Ranges from which each leg in training draws its own numbers."""

_RANGES: dict[Randomise, tuple[Range, ...]] = {
    "none": (),
    "twins": IDENTIFIABLE_RANGES,
    "surprises": WIDE_RANGES,
}

_OF_TASK = ("task.fall_penalty", "task.timestep")
"""Numbers of a task that ``--set`` changes; most go with the robot's size or have options of their
own."""

_TEXTS = {"memory": get_args(get_type_hints(StudentConfig)["memory"])}
"""Options that are one of some words."""

_KINDS = {bool: "true or false", int: "a whole number", float: "a number"}


def get_recipe(name: str) -> Recipe:
    """Return a shipped recipe, or that of ``path/to/file.py:NAME``, a ``Recipe`` or its maker.

    Raises ``UsageError`` for an unknown name, ``ControllerError`` for a file that gives none.
    """
    if ":" not in name and not name.endswith(".py"):
        if name not in RECIPES:
            raise UsageError(unknown_name("recipe", name, RECIPES))
        return RECIPES[name]
    _, found = find_user_object(name)
    recipe = found() if callable(found) else found
    if not isinstance(recipe, Recipe):
        raise UsageError(f"'{name}' is no recipe; name a Recipe, or a function that returns one.")
    return recipe


def change(recipe: Recipe, changes: Sequence[str]) -> Recipe:
    """Return a recipe with options changed by ``[part.]name=value``; ``UsageError`` for no such."""
    known = settings_of(recipe)
    values: dict[str, Any] = {}
    for entry in changes:
        name, _, text = entry.partition("=")
        if name not in known:
            raise UsageError(unknown_name(f"number of recipe '{recipe.name}'", name, known))
        if name in _TEXTS and text not in _TEXTS[name]:
            raise UsageError(unknown_name(f"value of '{name}'", text, _TEXTS[name]))
        kind = type(known[name])
        try:
            values[name] = msgspec.convert(text, kind, strict=False)
        except msgspec.ValidationError:
            values[name] = math.nan
        if kind is not str and not math.isfinite(values[name]):
            raise UsageError(
                f"'{entry}' does not say {_KINDS[kind]}; give e.g. {name}={known[name]}."
            )
    return recipe.replace(values)


def randomise(recipe: Recipe, ranges: Randomise) -> Recipe:
    """Return the recipe on legs that each draw their own numbers from ranges."""
    return recipe.replace({"task.randomised": _RANGES[ranges]})


def settings_of(recipe: Recipe) -> dict[str, int | float | str]:
    """Return by name the options of a recipe that ``--set`` changes."""
    found = {name: attrgetter(path)(recipe) for name, path in recipe.paths().items()}
    return {
        name: value
        for name, value in found.items()
        if name in _TEXTS
        or (isinstance(value, int | float) and (not name.startswith("task.") or name in _OF_TASK))
    }
