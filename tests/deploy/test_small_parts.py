import contextlib
import gc
import math
import os
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hopping_leg.controllers.command_schedule import (
    CommandSchedule,
    check_schedule,
    command_range,
)
from hopping_leg.controllers.registry import load_controller
from hopping_leg.deploy import realtime
from hopping_leg.deploy.drive_link import Reply
from hopping_leg.deploy.keyboard import LiveHeight, handle_key
from hopping_leg.deploy.motion_sequence import Part, SequenceTiming, hopping_poses
from hopping_leg.deploy.sample_buffer import SampleBuffer
from hopping_leg.errors import UsageError
from hopping_leg.robot import kinematics, load_robot, shipped_robots
from hopping_leg.robot.limits import command_limits

LEG = load_robot("legv2-paper")


def reply(position):
    return Reply(position, 10 * position, 0.0, 10, 0, 24.0, 30.0, 0.0)


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


def test_keys_raise_lower_and_stop():
    height, stops = LiveHeight(0.30, (0.25, 0.35)), []
    for _ in range(3):
        handle_key(b"+", height, lambda: stops.append(1))
    assert height.at(0) == pytest.approx(0.33)
    for _ in range(20):
        handle_key(b"\x1b[B", height, lambda: stops.append(1))
    assert height.at(0) == 0.25
    assert handle_key(b"x", height, lambda: stops.append(1)) == ""
    assert handle_key(b"+", None, lambda: stops.append(1)) == ""
    assert not stops
    for key in (b" ", b"q", b"\n"):
        assert handle_key(key, height, lambda: stops.append(1)) == "stopping"
    assert len(stops) == 3


def test_a_late_reply_is_put_where_it_belongs():
    samples = SampleBuffer(0.005)
    for tick in range(5):
        samples.put(tick, 0, reply(tick))
        if tick != 3:
            samples.put(tick, 1, reply(-tick))
    seen = samples.measurement(4, 0.3)
    np.testing.assert_allclose(seen.age[0], [0, 0.010, 0.015])
    np.testing.assert_allclose(seen.q[0, :, 0], [4, 2, 1])
    samples.put(3, 1, reply(-3))
    seen = samples.measurement(5, 0.25)
    np.testing.assert_allclose(seen.age[0], [0.005, 0.010, 0.015])
    np.testing.assert_allclose(seen.q[0], [[4, -4], [3, -3], [2, -2]])
    np.testing.assert_allclose(seen.qd, 10 * seen.q)
    np.testing.assert_allclose(seen.command[0], [0.3, 0.25, 0.25])


def test_one_sample_stands_for_the_past_and_none_is_an_error():
    samples = SampleBuffer(0.005)
    with pytest.raises(ValueError, match="both joints"):
        samples.measurement(0, 0.3)
    samples.put(0, 0, reply(1))
    assert not samples.complete()
    samples.put(0, 1, reply(2))
    seen = samples.measurement(0, 0.3)
    assert seen.q.shape == seen.qd.shape == (1, 3, 2)
    np.testing.assert_allclose(seen.q[0], [[1, 2]] * 3)


def test_the_parts_of_a_sequence_follow_each_other():
    timing = SequenceTiming(hop=10, rise=2, settle=0.5, sink=1.5)
    times = [0, 1.9, 2, 2.4, 2.5, 12.4, 12.5, 13.9, 14.0, 99]
    parts = [timing.phase(t)[0] for t in times]
    assert parts == [
        *(Part.RISE, Part.RISE, Part.SETTLE, Part.SETTLE, Part.HOP),
        *(Part.HOP, Part.SINK, Part.SINK, Part.DONE, Part.DONE),
    ]


@given(st.integers(1, 3000), st.floats(0, 1e6))
def test_a_hop_of_some_ticks_lasts_so_many_wherever_time_began(ticks, began):
    timing = SequenceTiming(hop=ticks / 200, rise=0.4, settle=0.1)
    times = began + np.arange(ticks + 200) * 0.005 - began
    parts = [timing.phase(time)[0] for time in times]
    assert parts.count(Part.HOP) == ticks


@pytest.mark.parametrize("name", [n for n in shipped_robots() if load_robot(n).kind == "leg"])
def test_poses_lie_within_the_soft_limits_with_the_foot_below_the_hip(name):
    robot = load_robot(name)
    poses = hopping_poses(robot)
    for pose in (poses.start, poses.rest):
        assert kinematics.foot_position(robot, pose)[1] == pytest.approx(0, abs=1e-9)
        assert (pose >= robot.of_joints("lower")).all()
        assert (pose <= robot.of_joints("upper")).all()


def test_garbage_collection_is_held_off_and_comes_back():
    interval = sys.getswitchinterval()
    with contextlib.suppress(RuntimeError), realtime.uninterrupted():
        assert not gc.isenabled()
        raise RuntimeError
    assert gc.isenabled()
    assert sys.getswitchinterval() == interval


def test_what_is_not_permitted_is_a_notice(monkeypatch):
    def refuse(*_):
        raise PermissionError

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    assert "SCHED_FIFO" in realtime.prefer_this_process()
    with realtime.keeping_time(realtime=False) as notices:
        assert notices == ()
