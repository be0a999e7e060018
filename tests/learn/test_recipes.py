"""Recipes changed from the command line: what a card prints gives the same recipe again."""

import dataclasses

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hopping_leg.errors import UsageError
from hopping_leg.learn.recipes import RECIPES, change, changes_of, get_recipe


@given(
    name=st.sampled_from(sorted(RECIPES)),
    steps=st.integers(1, 10**9),
    rate=st.floats(1e-9, 1.0),
    privileged=st.booleans(),
)
def test_a_cards_changes_give_the_recipe_again(name, steps, rate, privileged):
    recipe = dataclasses.replace(
        get_recipe(name), steps=steps, learning_rate=rate, privileged_critic=privileged
    )
    stored = dataclasses.asdict(recipe)
    assert change(get_recipe(name), changes_of(name, stored)) == recipe


@pytest.mark.parametrize(
    ("entry", "named"),
    [
        ("speed=3", "steps"),
        ("steps=many", "a whole number"),
        ("learning_rate=nan", "a number"),
        ("privileged_critic=perhaps", "true or false"),
    ],
)
def test_changes_without_meaning_get_a_sentence(entry, named):
    with pytest.raises(UsageError, match=named):
        change(get_recipe("fast"), [entry])
