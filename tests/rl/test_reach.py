"""What the teacher reaches is asked, on a robot and on legs of any size, and is found once."""

import dataclasses
import math

import pytest

from hopping_leg.errors import UsageError
from hopping_leg.rl import reach
from hopping_leg.rl.policy_evaluation import CommandResult
from hopping_leg.rl.reach import find_legs, within_reach
from hopping_leg.rl.recipes import RECIPES
from hopping_leg.workers import ProcessWorkers
from tests.rl.learners import ROBOT

FAST = RECIPES["fast"].replace(heights=(0.26, 0.40)).fit(ROBOT)
ANY = RECIPES["universal"]
HEIGHTS = ANY.task.command_range
TEACHER = ANY.algorithm.teacher, ANY.algorithm.planning


class Here:
    """Workers that keep what they are asked for."""

    def __init__(self):
        self.asked = []

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def map(self, function, arguments):
        for values in arguments:
            self.asked.append(str(values[0]))
            yield function(*values)


@pytest.fixture(autouse=True)
def here(monkeypatch):
    workers = Here()
    monkeypatch.setattr(reach, "_AT_ONCE", 2)
    monkeypatch.setattr(reach, "ProcessWorkers", lambda _: workers)
    return workers


def find(folder, count, seed=0):
    told = []
    found = find_legs(ANY.replace(num_envs=count), seed, folder / "legs.json", 1, None, told.append)
    assert not told or told[-1] == 1
    return found


def test_legs_are_asked_for_heights_of_their_own_size(tmp_path):
    found = find(tmp_path, 5)
    assert len({leg.true.digest for leg in found}) == 5
    for leg in found:
        low, high = leg.command_range
        assert leg.true.size * HEIGHTS[0] <= low + 1e-9
        assert low < high <= leg.true.size * HEIGHTS[1] + 1e-9


def test_what_was_found_is_not_looked_for_again_and_no_worker_changes_it(
    tmp_path, here, monkeypatch
):
    found = find(tmp_path, 5)
    first = here.asked[:]
    assert find(tmp_path, 3) == found[:3]
    assert here.asked == first
    more = find(tmp_path, 8)
    assert more[:5] == found
    assert len(set(here.asked)) == len(here.asked)
    digests = {leg.true.digest for leg in found}
    assert not {leg.true.digest for leg in find(tmp_path / "seed", 2, seed=1)} & digests
    monkeypatch.setattr(reach, "ProcessWorkers", ProcessWorkers)
    assert find(tmp_path / "others", 8) == more


def test_a_leg_that_hardly_hops_is_left_out(monkeypatch):
    monkeypatch.setattr(reach, "_hops", lambda *_: False)
    assert reach.find_reach(0, HEIGHTS, *TEACHER) is None


def test_a_damaged_file_is_one_sentence(tmp_path):
    found = find(tmp_path, 1)
    for content in (b"{", b'{"asked": 1', b"[]"):
        (tmp_path / "legs.json").write_bytes(content)
        with pytest.raises(UsageError):
            find(tmp_path, 1)
    assert find(tmp_path / "new", 1) == found


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
    assert within_reach(paper, ROBOT) == paper


def test_a_leg_whose_motors_are_too_slow_is_asked_for_lower_hops():
    assert within_reach(FAST, ROBOT) == FAST
    recipe = within_reach(FAST, with_motors(no_load_speed=0.7))
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

    monkeypatch.setattr(reach, "evaluate_policy", evaluate_policy)
    recipe = within_reach(FAST, ROBOT)
    assert recipe.task.command_range == pytest.approx(range_m)
    names = [round(0.26 + k / 100, 2) for k in range(15)]
    missed.update({h: {"hops": 0} for h in names if h not in names[3:5]})
    with pytest.raises(UsageError, match=r"between 0\.26 and 0\.4 m .*; check masses"):
        within_reach(FAST, ROBOT)
