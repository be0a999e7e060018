import dataclasses

import numpy as np
import pytest

from hopping_leg.errors import UsageError
from hopping_leg.evaluate.trials import COMMANDS, paper_trials, scaled, within


def by_kind(trials, kind):
    return [t for t in trials if t.kind == kind]


def test_the_papers_trials(robot):
    trials = paper_trials(robot)
    assert len({t.name for t in trials}) == len(trials)
    assert [t.steps for t in by_kind(trials, "fixed")] == [((c, 15.0),) for c in COMMANDS]
    (staircase,) = by_kind(trials, "staircase")
    commands = staircase.commands(200.0)
    assert len(commands) == 6000
    assert np.allclose(np.unique(commands), [0.25, 0.27, 0.29, 0.31, 0.33, 0.35])
    (sequence,) = by_kind(trials, "sequence")
    assert np.allclose(sequence.commands(200.0)[[0, 999, 1000, 2999]], [0.25, 0.25, 0.30, 0.35])


def test_heights_scale_with_the_leg(robot):
    thigh = dataclasses.replace(robot.thigh, length=0.45)
    longer = dataclasses.replace(robot, thigh=thigh)
    assert scaled(COMMANDS, robot) == COMMANDS
    assert scaled(COMMANDS, longer) == pytest.approx((0.5, 0.6, 0.7))


@pytest.mark.parametrize("height", [0.05, 3.0, float("nan"), -0.3])
def test_heights_out_of_reach_are_refused(robot, height):
    with pytest.raises(UsageError, match="out of reach of legv2-paper"):
        paper_trials(robot, [0.3, height])


def test_a_trial_outside_a_range_does_not_fit(robot):
    ladder = by_kind(paper_trials(robot), "ladder")
    fitting = [t.steps[0][0] for t in ladder if within(t, (0.25, 0.35))]
    assert fitting == [0.26, 0.28, 0.30, 0.32, 0.34]
    assert all(within(t, None) for t in ladder)
