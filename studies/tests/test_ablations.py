"""Variants differ from the recipe in one part, train as long, and are judged alike."""

import itertools
import json
from operator import attrgetter

import pytest

pytest.importorskip("torch", reason="the extra 'train' is not installed")

from tests.rl.learners import ROBOT, TINY_FAST, try_briefly

from hopping_leg.rl.recipe import Recipe
from hopping_leg.rl.recipes.fast import FAST
from studies.ablations import run as module
from studies.ablations.run import VARIANTS, Ablation
from studies.shared import ROOT, main

ROLLOUT = TINY_FAST.algorithm.n_steps * TINY_FAST.schedule.num_envs


@pytest.fixture
def tiny(monkeypatch):
    """Let `fast` be small and its trials short; return the numbers of its trainings."""
    monkeypatch.setattr(module, "FAST", TINY_FAST)
    monkeypatch.setattr(module, "within_reach", lambda recipe, robot: recipe)
    try_briefly(monkeypatch)
    trained = []

    make = Recipe.make_learner

    def noted(recipe, robot, seed):
        trained.append((recipe.network.hidden, recipe.schedule.steps, seed))
        return make(recipe, robot, seed)

    monkeypatch.setattr(Recipe, "make_learner", noted)
    return trained


def test_variants_differ_from_the_recipe_and_from_each_other_in_what_they_name():
    made = [FAST.replace(changes) for _, changes in VARIANTS.values()]
    assert len({repr(variant) for variant in made}) == len(VARIANTS)
    assert made[0] == FAST
    for recipe, (_, changes) in zip(made, VARIANTS.values(), strict=True):
        paths = {n: attrgetter(path) for n, path in FAST.paths().items()}
        differing = {n for n, value in paths.items() if value(recipe) != value(FAST)}
        assert differing == set(changes)


def test_every_variant_trains_as_long_with_every_seed_and_once(tiny, tmp_path):
    study = Ablation(("small", "recipe"), (0, 1), 2 * ROLLOUT, ROBOT.name, tmp_path)
    found = study.measure()
    own = TINY_FAST.network.hidden
    assert tiny == [(hidden, 2 * ROLLOUT, seed) for hidden in ((64, 64), own) for seed in (0, 1)]
    found_of = [(r["variant"], r["seed"]) for r in found["rows"]]
    assert found_of == list(itertools.product(("small", "recipe"), (0, 1)))
    assert [row["runs"] for row in found["variants"]] == [2, 2]
    assert json.dumps(study.measure()) == json.dumps(found)
    assert len(tiny) == 4
    assert main("ablations", Ablation, ["--variants", "smal"]) == 2


def test_a_variant_is_summed_up_over_seeds_its_worst_height_being_that_of_any():
    keys = ("mean_abs_median_error_m", "worst_abs_median_error_m", "mean_std_m", "skipped_hops")
    runs = (("a", 0.002, 0.01, 0.004, 3), ("a", 0.004, 0.006, 0.006, 1), ("b", 0.1, 0.2, 0.3, 0))
    rows = [
        {"meaning": "", "body_contact_ticks": 1} | dict(zip(("variant", *keys), run, strict=True))
        for run in runs
    ]
    first, second = module.over_seeds(rows)
    assert (first["variant"], first["runs"]) == ("a", 2)
    assert [first[key] for key in keys] == pytest.approx([0.003, 0.010, 0.005, 4])
    assert first["body_contact_ticks"] == 2
    assert second["runs"] == 1


def test_a_longer_push_scatters_less_as_the_pages_say():
    stored = json.loads((ROOT / "studies/ablations/results/ablations.json").read_text())
    std = {row["variant"]: row["mean_std_m"] for row in stored["variants"]}
    assert std["long-push"] < 0.85 * std["recipe"]
