"""Each ablation differs from its recipe in something."""

import dataclasses

import pytest

from hopping_leg.learn.ablations import ABLATIONS
from hopping_leg.learn.recipes import get_recipe


@pytest.mark.parametrize("recipe", ABLATIONS)
def test_the_recipe_comes_first_and_every_variant_differs(recipe):
    first, *others = ABLATIONS[recipe]()
    longer = {"teaching": first.recipe.teaching} if recipe == "precise" else {}
    assert first.recipe == dataclasses.replace(get_recipe(recipe), **longer)
    options = [dataclasses.asdict(a.recipe) | {"recipe": a.recipe.name} for a in (first, *others)]
    assert all(options.count(one) == 1 for one in options)
    assert len({a.name for a in (first, *others)}) == len(options)


def test_a_teacher_has_as_many_steps_in_an_ablation_of_half_the_length_as_in_the_recipe():
    whole, short = get_recipe("precise"), ABLATIONS["precise"]()[0].recipe
    assert short.teaching / 2 == pytest.approx(whole.teaching, abs=0.01)
