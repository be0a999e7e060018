import pytest

from hopping_leg.rl.recipes.fast import FAST
from hopping_leg.rl.recipes.paper import PAPER
from hopping_leg.rl.recipes.precise import PRECISE
from hopping_leg.robot import load_robot, shipped_robots

LEGS = [
    name
    for name in shipped_robots()
    if load_robot(name).kind == "leg" and load_robot(name).reality.neutral
]


def test_the_papers_leg_keeps_the_recipe():
    assert PAPER.fit(load_robot("legv2-paper")) == PAPER


@pytest.mark.parametrize("recipe", [PAPER, FAST], ids=["paper", "fast"])
@pytest.mark.parametrize("name", LEGS)
def test_every_shipped_leg_can_stand_and_reach_its_commands(recipe, name):
    robot = load_robot(name)
    fitted = recipe.fit(robot)
    low, high = fitted.task.command_bounds
    assert 0.6 * robot.straight_height < low < high < 1.5 * robot.straight_height
    assert low <= min(fitted.selection.eval_commands) <= max(fitted.selection.eval_commands) <= high
    assert (fitted.task.action_torque <= robot.of_joints("torque_limit")).all()
    env = fitted.make_env(robot, 0)
    assert (env.task.legs.height > 0.3 * robot.straight_height).all()


@pytest.mark.parametrize("recipe", [PAPER, PRECISE], ids=["paper", "precise"])
@pytest.mark.parametrize("name", LEGS)
def test_heights_that_are_asked_for_are_those_of_any_leg(recipe, name):
    asked = recipe.replace(heights=(0.21, 0.47))
    fitted = asked.fit(load_robot(name))
    assert fitted.task.command_bounds == (0.21, 0.47)
    assert len(fitted.selection.eval_commands) == len(recipe.selection.eval_commands)
    assert 0.21 < min(fitted.selection.eval_commands) < max(fitted.selection.eval_commands) < 0.47
    assert fitted.task.action_torque == recipe.fit(load_robot(name)).task.action_torque
