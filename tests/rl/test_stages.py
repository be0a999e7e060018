"""The stages of a distillation: what the teacher reaches is asked, and every stage is judged."""

import dataclasses
import json
import math

import pytest

from hopping_leg.controllers.policy import Policy
from hopping_leg.errors import UsageError
from hopping_leg.rl import stages
from hopping_leg.rl.policy_evaluation import CommandResult
from hopping_leg.rl.recipes import RECIPES
from hopping_leg.rl.run_folder import RunFolder
from hopping_leg.rl.train import train
from tests.rl.learners import ROBOT, TINY_FAST, try_briefly

FAST = RECIPES["fast"].replace(heights=(0.26, 0.40)).fit(ROBOT)


def with_motors(**factors):
    """Return the leg with other motors, changed by factors."""
    joints = {}
    for name in ("hip", "knee"):
        joint = getattr(ROBOT, name)
        numbers = {key: factor * getattr(joint.motor, key) for key, factor in factors.items()}
        motor = dataclasses.replace(joint.motor, **numbers)
        joints[name] = dataclasses.replace(joint, motor=motor)
    return dataclasses.replace(ROBOT, name="changed", **joints)


def test_a_recipe_without_a_teacher_stays_as_it_is():
    paper = RECIPES["paper"]
    assert stages.within_reach(paper, ROBOT) == (paper, 0.0)
    assert stages.stages_of(paper) == ()


def test_a_leg_whose_motors_are_too_slow_is_asked_for_lower_hops():
    whole, score = stages.within_reach(FAST, ROBOT)
    assert whole == FAST
    assert 0 < score < stages.stages_of(FAST)[0].must_score
    recipe, _ = stages.within_reach(FAST, with_motors(no_load_speed=0.7))
    low, high = recipe.task.command_range
    assert low == FAST.task.command_range[0]
    assert 0.28 <= high <= 0.38
    assert low < min(recipe.selection.eval_commands) < max(recipe.selection.eval_commands) < high


@pytest.mark.parametrize(
    ("missed", "range_m"),
    [
        ({}, (0.26, 0.40)),
        ({0.29: {"skipped_hops": 1}}, (0.30, 0.40)),
        ({0.36: {"median_error_m": 0.006}, 0.40: {"hops": 0}}, (0.26, 0.35)),
        ({0.36: {"median_error_m": math.nan}}, (0.26, 0.35)),
    ],
)
def test_the_longest_run_of_heights_is_asked(monkeypatch, missed, range_m):
    usual = CommandResult(0.3, 0.004, 0.001, 20, 2.0, 0.5, 0, 0, 0.1)

    def evaluate_policy(teacher, robot, heights, **_):
        found = {round(h, 3): dataclasses.replace(usual, command_m=h) for h in heights}
        return [dataclasses.replace(r, **missed.get(h, {})) for h, r in found.items()]

    monkeypatch.setattr(stages, "evaluate_policy", evaluate_policy)
    recipe, score = stages.within_reach(FAST, ROBOT)
    assert recipe.task.command_range == pytest.approx(range_m)
    assert score == pytest.approx(0.005), "of the heights that are asked"
    names = [round(0.26 + k / 100, 2) for k in range(15)]
    missed.update({h: {"hops": 0} for h in names if h not in names[3:5]})
    with pytest.raises(UsageError, match=r"between 0\.26 and 0\.4 m .*; check masses"):
        stages.within_reach(FAST, ROBOT)


def test_a_training_tells_how_its_stages_ended(tmp_path, monkeypatch):
    try_briefly(monkeypatch)
    train(TINY_FAST, ROBOT, 0, tmp_path, quiet=True)
    result = json.loads((tmp_path / "result.json").read_text())
    rows, due = result["stages"], stages.stages_of(TINY_FAST)
    assert [row["name"] for row in rows] == [stage.name for stage in due]
    assert [row["until"] for row in rows] == [0.0, 0.4, 1.0, 1.0]
    assert [row["seconds"] for row in rows] == sorted(row["seconds"] for row in rows)
    for row, stage in zip(rows, due, strict=True):
        assert row["passed"] == (row["score_m"] <= stage.must_score)
    assert rows[0]["passed"]
    assert not rows[2]["passed"], "after seconds of training"
    assert rows[3]["score_m"] == result["selected"]["worst_score_m"]
    card = (tmp_path / "model_card.md").read_text()
    assert all(f"  - {row['name']}: {row['score']}" in card for row in rows)


def test_a_run_is_known_by_what_was_asked_and_its_card_says_what_is_in_reach(tmp_path, monkeypatch):
    def within_reach(recipe, robot):
        return recipe.replace({"task.command_range": (0.28, 0.30)}, eval_commands=(0.29,)), 0.001

    try_briefly(monkeypatch)
    monkeypatch.setattr(stages, "within_reach", within_reach)
    trained = train(TINY_FAST, ROBOT, 0, tmp_path, quiet=True)
    RunFolder(tmp_path, TINY_FAST.fit(ROBOT), ROBOT, 0, None).check_same()
    card = Policy.load(trained.policy).card
    assert (card.command_low, card.command_high) == (0.28, 0.30)
