"""What the teacher reaches is asked, on a robot and on legs of any size, and is found once."""

import dataclasses
import math

import pytest

from hopping_leg.controllers.mpc import HopShape, Planning
from hopping_leg.errors import UsageError
from hopping_leg.rl import reach
from hopping_leg.rl.policy_evaluation import CommandResult
from hopping_leg.rl.reach import Reach, reach_of_legs, task_leg, within_reach
from hopping_leg.rl.recipes import RECIPES
from hopping_leg.rl.train import stages_of
from hopping_leg.sim.any_leg import draw_any_leg
from hopping_leg.workers import ProcessWorkers
from tests.rl.learners import ROBOT

FAST = RECIPES["fast"].replace(heights=(0.26, 0.40)).fit(ROBOT)
HEIGHTS = (0.21, 0.42)
TEACHER = (HopShape(), Planning(timestep=1.25e-3, elastic_timestep=5e-4, every=2))


class Here:
    """Workers that count what they are asked for."""

    count = 1

    def __init__(self):
        self.asked = []

    def map(self, function, arguments):
        self.asked += [values[0] for values in arguments]
        return [function(*values) for values in arguments]


@pytest.fixture(autouse=True)
def _few(monkeypatch):
    monkeypatch.setattr(reach, "_AT_ONCE", 2)
    monkeypatch.setattr(reach, "_ROUND", 4)


def find(folder, count, workers, seed=0, heights=HEIGHTS):
    told = []
    found = reach_of_legs(count, seed, heights, TEACHER, workers, folder / "legs.json", told.append)
    assert not told or told[-1] == count
    return found


def test_legs_are_asked_for_heights_of_their_own_size(tmp_path):
    found = find(tmp_path, 5, Here())
    assert len({one.leg for one in found}) == 5
    for one in found:
        scale = draw_any_leg(one.leg).true.straight_height / 0.30
        assert HEIGHTS[0] <= one.low / scale + 1e-9
        assert one.low < one.high <= scale * HEIGHTS[1] + 1e-9
        leg = task_leg(one)
        assert leg.command_range == (one.low, one.high)
        assert leg.true == draw_any_leg(one.leg).true


def test_what_was_found_is_not_looked_for_again_and_no_worker_changes_it(tmp_path):
    first = Here()
    found = find(tmp_path, 5, first)
    again = Here()
    assert find(tmp_path, 3, again) == found[:3]
    assert again.asked == []
    more = find(tmp_path, 8, again)
    assert more[:5] == found
    assert not set(map(str, again.asked)) & set(map(str, first.asked))
    with ProcessWorkers(1) as processes:
        assert find(tmp_path / "others", 8, processes) == more
    other = Here()
    assert not {r.leg for r in find(tmp_path, 2, other, seed=1)} & {r.leg for r in found}


def test_a_leg_that_hardly_hops_is_left_out(monkeypatch):
    monkeypatch.setattr(reach, "_hops", lambda *_: False)
    assert reach.find_reach(0, HEIGHTS, *TEACHER) is None


def test_a_damaged_file_is_one_sentence(tmp_path):
    find(tmp_path, 1, Here())
    for content in (b"{", b'{"asked": 1', b"[]"):
        (tmp_path / "legs.json").write_bytes(content)
        with pytest.raises(UsageError):
            find(tmp_path, 1, Here())
    assert isinstance(find(tmp_path / "new", 1, Here())[0], Reach)


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
    assert within_reach(paper, ROBOT) == (paper, 0.0)
    assert stages_of(paper) == ()


def test_a_leg_whose_motors_are_too_slow_is_asked_for_lower_hops():
    whole, score = within_reach(FAST, ROBOT)
    assert whole == FAST
    assert 0 < score < stages_of(FAST)[0].must_score
    recipe, _ = within_reach(FAST, with_motors(no_load_speed=0.7))
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
    recipe, score = within_reach(FAST, ROBOT)
    assert recipe.task.command_range == pytest.approx(range_m)
    assert score == pytest.approx(0.005), "of the heights that are asked"
    names = [round(0.26 + k / 100, 2) for k in range(15)]
    missed.update({h: {"hops": 0} for h in names if h not in names[3:5]})
    with pytest.raises(UsageError, match=r"between 0\.26 and 0\.4 m .*; check masses"):
        within_reach(FAST, ROBOT)
