"""A training: on which legs, at which heights, and what its card says."""

import numpy as np
import pytest

from hopping_leg.controllers.policy import Policy
from hopping_leg.errors import RobotError, UsageError
from hopping_leg.io import replace_at
from hopping_leg.rl import reach
from hopping_leg.rl.recipes import get_recipe
from hopping_leg.rl.run_folder import RunFolder, read_result
from hopping_leg.rl.train import train
from hopping_leg.robot import load_robot
from tests.rl.learners import ROBOT, TINY_FAST, learn, learner, try_briefly


def test_a_leg_with_a_belt_and_jitter_is_trained_on_as_its_motors_see_it(tmp_path, monkeypatch):
    stated = {"knee.stiffness": 400.0, "knee.stiffness_damping": 0.03, "latency.jitter": 1e-3}
    belted = load_robot("legv2")
    for name, value in stated.items():
        belted = replace_at(belted, f"reality.{name}", value)
    made = learn(learner(TINY_FAST, robot=belted), 320)
    legs = made.task.legs
    np.testing.assert_array_equal(legs.measured_q, legs.records["rotor"][:, :2])
    assert np.abs(legs.measured_q - legs.q)[:, 1].max() > 1e-3
    try_briefly(monkeypatch)
    policy = train(TINY_FAST, belted, 0, tmp_path, quiet=True)
    assert Policy.load(policy).card.robot_digest == belted.digest
    with pytest.raises(RobotError, match="beyond transmissions"):
        train(TINY_FAST, replace_at(belted, "reality.knee.ripple", 0.1), 0, tmp_path)


def test_a_run_is_known_by_what_was_asked_and_its_card_says_what_is_in_reach(tmp_path, monkeypatch):
    def within_reach(recipe, robot):
        return recipe.replace({"task.command_range": (0.28, 0.30)}, eval_commands=(0.29,))

    try_briefly(monkeypatch)
    monkeypatch.setattr(reach, "within_reach", within_reach)
    policy = train(TINY_FAST, ROBOT, 0, tmp_path, quiet=True)
    RunFolder(tmp_path, TINY_FAST.fit(ROBOT), ROBOT, 0, None).check_same()
    card = Policy.load(policy).card
    assert (card.command_low, card.command_high) == (0.28, 0.30)
    told = (tmp_path / "model_card.md").read_text()
    assert "\namong them the age of each joint sample, which the paper's 15 lack" in told


def test_workers_that_do_not_fit_are_refused_before_anything_is_written(tmp_path):
    for name, workers, ray, says in (
        ("rl", 3, None, "num_envs, 1024, must be a multiple of workers, 3"),
        ("fast", 0, None, "must be a multiple of workers, 0"),
        ("fast", 1, "local", "more than one worker"),
        ("paper", 1, "local", "one worker, here; leave workers and --ray out"),
        ("paper", 2, None, "one worker, here; leave workers and --ray out"),
    ):
        recipe = get_recipe(name).replace(workers=workers)
        with pytest.raises(UsageError, match=says):
            train(recipe, ROBOT, 0, tmp_path / "run", ray=ray)
    assert not (tmp_path / "run").exists()


def test_minutes_count_from_the_first_rollout_on(tmp_path, monkeypatch):
    try_briefly(monkeypatch)
    train(TINY_FAST, ROBOT, 0, tmp_path, minutes=1e-6, quiet=True)
    assert 0 < read_result(tmp_path)["steps"] < TINY_FAST.schedule.steps
