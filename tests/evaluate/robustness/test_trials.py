"""What is met depends on the seed alone, grows with the level and is nothing at the neutral one."""

import dataclasses

import numpy as np
import pytest

from hopping_leg.controllers import rollout
from hopping_leg.errors import UsageError
from hopping_leg.evaluate.robustness.axes import AXES, JOINT, NOMINAL, Case, axis_names
from hopping_leg.evaluate.robustness.outcome import run_axis
from hopping_leg.evaluate.robustness.trials import PUSH_SECONDS, make_trials
from hopping_leg.sim import LegSimulator

COMMANDS = (0.25, 0.35)
LEADERBOARD = {"model error", "velocity noise", "torque noise", "torque response"}
LEADERBOARD |= {"delay", "perturbation"}


def plan(robot, axis, **options):
    return make_trials(axis, robot, COMMANDS, 2, options.pop("seed", 1000), rate=200.0, **options)


def arrays(made):
    found = made.perturbation
    return (made.commands, found.torque, found.force, found.ground)


@pytest.mark.parametrize("axis", AXES, ids=lambda axis: axis.name)
def test_a_neutral_level_is_the_plain_rollout_bit_for_bit(setup, robot, spring, axis):
    made = plan(robot, axis.name, levels=[axis.neutral], seconds=2.6)
    found = rollout(spring, setup, made.commands, made.seed, perturbation=made.perturbation)
    asked = np.tile(np.repeat(COMMANDS, 2), (len(found.time), 1))
    plain = rollout(spring, setup, asked, made.seed)
    for name, values in plain.data.items():
        np.testing.assert_array_equal(found.data[name], values)


@pytest.mark.parametrize("axis", AXES, ids=lambda axis: axis.name)
def test_levels_and_moderate_ranges_lie_around_the_neutral_level(robot, axis):
    low, high = axis.moderate
    assert low <= axis.neutral <= high
    assert axis.neutral not in axis.levels
    assert min(axis.levels) <= low or low == axis.neutral
    assert max(axis.levels) >= high or high == axis.neutral
    altered = [axis.alter(Case(robot), level) for level in axis.levels]
    assert len(set(map(repr, altered))) == len(axis.levels)
    for case in altered:
        assert case.robot.thigh.length == robot.thigh.length
    assert LegSimulator(robot, len(altered), robots=[case.robot for case in altered]).count


def test_the_leaderboards_axes_are_among_them_and_unknown_ones_are_one_sentence(robot):
    assert {axis.leaderboard for axis in AXES} - {""} == LEADERBOARD
    assert axis_names()[-1] == JOINT
    assert len(plan(robot, NOMINAL).trials) == 4
    with pytest.raises(UsageError, match=r"no axis 'wind'.*pushes"):
        plan(robot, "wind")


@pytest.mark.parametrize("axis", ["pushes", "torque-noise", "ground-steps", JOINT])
def test_the_seed_fixes_what_happens(robot, axis):
    first, again, other = (plan(robot, axis, seed=seed) for seed in (1000, 1000, 1001))
    assert first.seed == again.seed != other.seed
    for one, same in zip(arrays(first), arrays(again), strict=True):
        np.testing.assert_array_equal(one, same)
    assert [t.case for t in first.trials] == [t.case for t in again.trials]
    if axis != "ground-steps":
        assert any((a != b).any() for a, b in zip(arrays(first), arrays(other), strict=True))


def test_levels_differ_in_size_only(robot):
    made = plan(robot, "pushes", levels=[0.1, 0.3])
    force = made.perturbation.force
    small, large = force[:, :4], force[:, 4:]
    np.testing.assert_allclose(large, 3 * small)
    moments = np.count_nonzero(small, axis=0)
    assert (moments == 9 * round(PUSH_SECONDS * 200)).all()
    assert np.abs(small).sum(axis=0) / 200 == pytest.approx(np.full(4, 0.9))


def test_commands_step_away_and_back_within_the_suites_heights(robot):
    made = make_trials("command-steps", robot, (0.25, 0.3, 0.35), 1, 0, rate=200.0, levels=[0.04])
    pairs = [sorted(set(made.commands[:, leg].round(6))) for leg in range(3)]
    assert pairs == [[0.25, 0.29], [0.28, 0.32], [0.31, 0.35]]
    assert (np.abs(np.diff(made.commands, axis=0)) > 0).sum() == 3 * 3


def test_the_hypercube_stays_within_its_share_of_the_moderate_ranges(robot):
    made = plan(robot, JOINT)
    for trial in made.trials:
        share = trial.level
        added = (trial.case.robot.base.mass - robot.base.mass) / robot.mass
        assert -0.15 * share <= added <= 0.2 * share
        assert 0 < trial.case.robot.reality.latency.command <= 0.005 * share
    points = {t.case.push / t.level for t in made.trials}
    assert len({round(p, 9) for p in points}) == len(made.trials) / 4


def test_controllers_meet_the_same_and_leave_it_as_it_was(setup, robot, spring):
    made = plan(robot, "pushes", levels=[0.5], seconds=3.0)
    before = [array.copy() for array in arrays(made)]
    first = run_axis(spring, setup, made)
    for one, same in zip(arrays(made), before, strict=True):
        np.testing.assert_array_equal(one, same)
    assert run_axis(spring, setup, made) == first
    weak = dataclasses.replace(made, seed=made.seed + 1)
    assert run_axis(spring, setup, weak) != first
