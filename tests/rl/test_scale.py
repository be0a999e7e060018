import dataclasses

import pytest
from hopping_leg.rl.scale import fit

from hopping_leg.rl.recipes.fast import FastRecipe
from hopping_leg.rl.recipes.paper import PaperRecipe
from hopping_leg.rl.recipes.precise import PreciseRecipe
from hopping_leg.robot import load_robot, shipped_robots

LEGS = [
    name
    for name in shipped_robots()
    if load_robot(name).kind == "leg" and load_robot(name).reality.neutral
]


def test_the_papers_leg_keeps_the_recipe():
    assert fit(PaperRecipe(), load_robot("legv2-paper")) == PaperRecipe()


@pytest.mark.parametrize("recipe", [PaperRecipe(), FastRecipe()], ids=["paper", "fast"])
@pytest.mark.parametrize("name", LEGS)
def test_every_shipped_leg_can_stand_and_reach_its_commands(recipe, name):
    robot = load_robot(name)
    fitted = fit(recipe, robot)
    low, high = fitted.task.command_bounds
    assert 0.6 * robot.straight_height < low < high < 1.5 * robot.straight_height
    assert low <= min(fitted.eval_commands) <= max(fitted.eval_commands) <= high
    assert (fitted.task.action_torque <= robot.of_joints("torque_limit")).all()
    env = fitted.__class__.make_env(fitted, robot, 0)
    assert (env.task.legs.height > 0.3 * robot.straight_height).all()


@pytest.mark.parametrize("recipe", [PaperRecipe(), PreciseRecipe()], ids=["paper", "precise"])
@pytest.mark.parametrize("name", LEGS)
def test_heights_that_are_asked_for_are_those_of_any_leg(recipe, name):
    asked = dataclasses.replace(recipe, heights=(0.21, 0.47))
    fitted = fit(asked, load_robot(name))
    assert fitted.task.command_bounds == (0.21, 0.47)
    assert len(fitted.eval_commands) == len(recipe.eval_commands)
    assert 0.21 < min(fitted.eval_commands) < max(fitted.eval_commands) < 0.47
    assert fitted.task.action_torque == fit(recipe, load_robot(name)).task.action_torque
