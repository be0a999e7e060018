import math

import pytest

from hopping_leg.controllers.command_schedule import CommandSchedule, check_schedule, command_range
from hopping_leg.controllers.registry import load_controller
from hopping_leg.errors import UsageError
from hopping_leg.robot import command_limits, load_robot

LEG = load_robot("legv2-paper")


def test_a_schedule_steps_and_stays():
    schedule = CommandSchedule.parse("0.25:5,0.30:2.5")
    assert [schedule.at(t) for t in (0, 4.99, 5, 100)] == [0.25, 0.25, 0.30, 0.30]
    assert schedule.seconds == 7.5


@pytest.mark.parametrize(
    "text", ["", "0.3", "0.3:0", "0.3:-1", "a:b", "0.3:1,", "nan:1", "0.3:inf"]
)
def test_what_is_no_schedule_is_refused(text):
    with pytest.raises(UsageError, match="no step of a schedule"):
        CommandSchedule.parse(text)


def test_a_policy_is_asked_for_what_it_was_trained_for_and_others_for_what_the_leg_reaches():
    policy = load_controller("fast", LEG)
    low, high = command_range(policy, LEG)
    assert (low, high) == (policy.card.command_low, policy.card.command_high)
    check_schedule(CommandSchedule(((low, 1.0), (high, 1.0))), (low, high), "fast")
    for height in (low - 0.01, high + 0.01, math.nan):
        with pytest.raises(UsageError, match="outside of what fast"):
            check_schedule(CommandSchedule(((height, 1.0),)), (low, high), "fast")
    assert command_range(load_controller("energy-shaping", LEG), LEG) == command_limits(LEG)
