"""Recipes are changed by name and fitted to legs; a card says what a policy misses."""

from pathlib import Path

import numpy as np
import pytest

from hopping_leg.controllers.registry import load_controller
from hopping_leg.envs import HoppingTask
from hopping_leg.errors import UsageError
from hopping_leg.rl.recipes import change, get_recipe, randomise, settings_of
from hopping_leg.rl.run_folder import MISSED, RunFolder, known_limits
from hopping_leg.robot import load_robot, shipped_robots

LEGS = [leg for leg in map(load_robot, shipped_robots()) if leg.kind == "leg"]
LEGS = [leg for leg in LEGS if leg.reality == leg.reality.in_training]
every_leg = pytest.mark.parametrize("robot", LEGS, ids=lambda robot: robot.name)


@pytest.mark.parametrize(
    ("name", "number", "value"),
    [
        ("paper", "reward.jerk", 0.5),
        ("fast", "teacher.taper", 0.25),
        ("fast", "memory", "gru"),
        ("fast", "n_steps", 7),
    ],
)
def test_numbers_of_a_part_are_changed_by_its_name(name, number, value):
    usual = get_recipe(name)
    changed, numbers = change(usual, [f"{number}={value}"]), settings_of(usual)
    assert settings_of(changed) == {**numbers, number: value} != numbers
    assert changed.replace({number: numbers[number]}) == usual


@pytest.mark.parametrize("name", ["paper", "fast"])
def test_a_randomised_recipe_trains_legs_that_differ(name):
    recipe, robot = get_recipe(name).replace(num_envs=3), load_robot("legv2")
    apart = []
    for one in (recipe, randomise(recipe, "twins")):
        learner = one.make_learner(robot, 0)
        legs = getattr(learner, "env", learner).task.legs
        legs.stand(slice(None), [0.7, -1.4], 0.05)
        for _ in range(40):
            legs.step(np.full((3, 2), [1.0, -3.0]))
        apart.append(np.ptp(legs.height))
    assert apart[0] == 0
    assert apart[1] > 1e-3


def test_a_recipe_of_ones_own_is_named_by_its_file(tmp_path):
    file = str(Path(__file__).parents[2] / "examples" / "custom_reward.py")
    quiet, robot = get_recipe(f"{file}:QUIET"), load_robot("legv2-paper")
    assert quiet.make_reward(robot).names[-1] == "torque"
    RunFolder(tmp_path, quiet, robot, 0, None).begin(new=True)
    RunFolder(tmp_path, get_recipe(f"{file}:QUIET"), robot, 0, None).check_same()
    with pytest.raises(UsageError, match="is no recipe"):
        get_recipe(f"{file}:Path")


@pytest.mark.parametrize("name", ["rl", "paper", "fast"])
@every_leg
def test_every_shipped_leg_can_stand_and_reach_its_heights_or_those_asked_for(robot, name):
    recipe = get_recipe(name)
    fitted, asked = recipe.fit(robot), recipe.replace(heights=(0.21, 0.47)).fit(robot)
    assert (name, robot.name) != ("paper", "legv2-paper") or fitted == recipe
    low, high = fitted.task.command_bounds
    assert 0.55 * robot.straight_height < low < high < 1.55 * robot.straight_height
    assert asked.task.command_bounds == (0.21, 0.47)
    for one in (fitted, asked):
        (low, high), judged = one.task.command_bounds, one.selection.eval_commands
        assert low <= min(judged) < max(judged) <= high
        assert len(judged) == len(recipe.selection.eval_commands)
        assert one.task.action_torque == fitted.task.action_torque
    assert (fitted.task.action_torque <= robot.of_joints("torque_limit")).all()
    task = HoppingTask(robot, 8, fitted.task, fitted.make_reward(robot), np.random.default_rng(0))
    assert (task.legs.height > 0.3 * robot.straight_height).all()


def test_a_card_names_every_command_that_its_own_simulation_misses_and_what_no_leg_was_like():
    def said(any_leg=False, **missed):
        rows = [{"command_m": int(n[1:]) / 1000, "median_error_m": e} for n, e in missed.items()]
        return known_limits(rows, any_leg)

    (told,) = said(_225=0.235, _250=0.004, _300=-0.021, _350=None)
    assert told.split(": ")[1].startswith("0.225 m (+235 mm), 0.3 m (-21 mm), 0.35 m (no hops);")
    assert said(_220=0.0, _250=MISSED, _300=-MISSED) == ()
    assert load_controller("universal", LEGS[0]).card.known_limits == said(any_leg=True)
