"""Each ablation differs from its recipe in something."""

import dataclasses

import pytest
from studies.ablations.variants import ABLATIONS

from hopping_leg.rl.recipes import get_recipe


@pytest.mark.parametrize("recipe", ABLATIONS)
def test_the_recipe_comes_first_and_every_variant_differs(recipe):
    first, *others = ABLATIONS[recipe]()
    assert first.recipe == get_recipe(recipe)
    options = [dataclasses.asdict(a.recipe) | {"recipe": a.recipe.name} for a in (first, *others)]
    assert all(options.count(one) == 1 for one in options)
    assert len({a.name for a in (first, *others)}) == len(options)
