"""The recipes by name."""

from hopping_leg.errors import UsageError, unknown_name
from hopping_leg.learn.fast import FastRecipe
from hopping_leg.learn.paper import PaperRecipe
from hopping_leg.learn.recipe import Recipe

RECIPES: dict[str, type[Recipe]] = {recipe.name: recipe for recipe in (FastRecipe, PaperRecipe)}
"""Every recipe that ``hop train`` knows."""


def get_recipe(name: str) -> Recipe:
    """Return a recipe with its defaults.

    Raises:
        UsageError: There is no such recipe.
    """
    if name not in RECIPES:
        raise UsageError(unknown_name("recipe", name, RECIPES))
    return RECIPES[name]()
