"""Recipes changed from the command line: what a card prints gives the same recipe again."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hopping_leg.envs import HoppingTask
from hopping_leg.errors import UsageError
from hopping_leg.rl.model_card import MISSED, missed_commands
from hopping_leg.rl.recipes import RECIPES, change, changes_of, get_recipe, randomise, words_of
from hopping_leg.rl.run_folder import RunFolder
from hopping_leg.robot import load_robot, shipped_robots
from hopping_leg.sim.randomization import IDENTIFIABLE_RANGES, WIDE_RANGES, Range

LEGS = [load_robot(name) for name in shipped_robots()]
LEGS = [robot for robot in LEGS if robot.kind == "leg" and robot.reality.only_delays]
every_leg = pytest.mark.parametrize("robot", LEGS, ids=lambda robot: robot.name)


@pytest.mark.parametrize(
    ("name", "number", "value"),
    [
        ("paper", "reward.jerk", 0.5),
        ("precise", "teacher.taper", 0.25),
        ("precise", "memory", "gru"),
        ("fast", "n_steps", 7),
    ],
)
def test_numbers_of_a_part_are_changed_by_its_name(name, number, value):
    usual = get_recipe(name)
    changed = change(usual, [f"{number}={value}"])
    assert changed.value(number) == value
    assert changes_of(usual, changed) == [f"{number}={value}"]
    assert changed.replace({number: usual.value(number)}) == usual


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


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"task.observation": "three-samples"}, "--observation three-samples"),
        ({"heights": (0.2, 0.46)}, "--heights 0.2 0.46"),
        ({"task.randomised": WIDE_RANGES}, "--randomise surprises"),
        ({"task.randomised": IDENTIFIABLE_RANGES}, "--randomise twins"),
        ({"task.randomised": (Range("base.mass", "kg", 0.3, 0.5, "own"),), "steps": 9}, "steps=9"),
    ],
)
def test_a_run_says_what_is_not_the_recipes(changes, words, tmp_path):
    recipe, robot = get_recipe("precise"), load_robot("legv2")
    assert words.split()[0] not in RunFolder(tmp_path, recipe, robot, 0, None).command
    told = RunFolder(tmp_path, recipe.replace(changes).fit(robot), robot, 0, None).command
    assert told.startswith("hop train --recipe precise")
    assert words in told
    assert ("--randomise" in told) == ("--randomise" in words), "ranges of one's own have no word"


@given(
    name=st.sampled_from(sorted(RECIPES)),
    numbers=st.fixed_dictionaries(
        {"steps": st.integers(1, 10**9)},
        optional={
            "learning_rate": st.floats(1e-9, 1.0),
            "task.timestep": st.sampled_from([1e-3, 5e-4]),
        },
    ),
    ranges=st.sampled_from([None, "none", "twins", "surprises"]),
    heights=st.sampled_from([None, (0.2, 0.4)]),
    observation=st.sampled_from([None, "three-samples", "dated"]),
)
def test_the_words_of_a_run_make_its_recipe(name, numbers, ranges, heights, observation):
    recipe = get_recipe(name).replace(numbers, heights=heights)
    if ranges is not None:
        recipe = randomise(recipe, ranges)
    if observation is not None:
        recipe = recipe.replace({"task.observation": observation})
    assert made_by(name, words_of(recipe)) == recipe


def made_by(name, words):
    """Return the recipe that ``hop train --recipe NAME`` makes with further words."""
    given: dict[str, list[str]] = {}
    for word in words:
        if word.startswith("--"):
            values = given.setdefault(word, [])
        else:
            values.append(word)
    recipe = change(get_recipe(name), given.get("--set", []))
    if "--randomise" in given:
        recipe = randomise(recipe, *given["--randomise"])
    if "--observation" in given:
        recipe = recipe.replace({"task.observation": given["--observation"][0]})
    heights = tuple(map(float, given["--heights"])) if "--heights" in given else None
    return recipe.replace(heights=heights)


def test_a_recipe_of_ones_own_is_named_by_its_file(tmp_path):
    file = str(Path(__file__).parents[2] / "examples" / "custom_reward.py")
    quiet = get_recipe(f"{file}:QUIET")
    robot = load_robot("legv2-paper")
    assert quiet.make_reward(robot).names[-1] == "torque"
    folder = RunFolder(tmp_path, quiet, robot, 0, None)
    assert f"--recipe {file}:QUIET" in folder.command
    slow = RunFolder(tmp_path, quiet.replace(learning_rate=0.01), robot, 0, None)
    assert slow.command.endswith("--set learning_rate=0.01")
    folder.write("config.json", folder.config)
    RunFolder(tmp_path, get_recipe(f"{file}:QUIET"), robot, 0, None).check_same()
    with pytest.raises(UsageError, match="is no recipe"):
        get_recipe(f"{file}:Path")


@pytest.mark.parametrize("name", ["paper", "fast", "precise"])
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


def trials(**errors):
    return [
        {"command_m": int(name[1:]) / 100, "median_error_m": error}
        for name, error in errors.items()
    ]


def test_a_card_names_every_command_that_its_own_simulation_misses():
    said = missed_commands(trials(_22=0.235, _25=0.004, _30=-0.021, _35=None))
    assert "0.22 m (+235 mm), 0.30 m (-21 mm), 0.35 m (no hops)" in said
    assert "0.25" not in said
    assert missed_commands(trials(_22=0.0, _25=MISSED, _30=-MISSED)) == ""
    between = [{"command_m": 0.225, "median_error_m": 0.03}]
    assert "0.225 m (+30 mm)" in missed_commands(between), "not rounded to another"
