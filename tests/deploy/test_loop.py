import contextlib
import gc
import itertools
import math
import os
import sys
from dataclasses import replace
from unittest.mock import Mock

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hopping_leg.controllers.joint_pd import JointGains
from hopping_leg.deploy import realtime
from hopping_leg.deploy.drive_link import BRAKE, STOP, Action, DriveMode, Reply
from hopping_leg.deploy.loop import SampleBuffer, columns
from hopping_leg.deploy.motion_sequence import Part, SequenceTiming, hopping_poses
from hopping_leg.deploy.standing_check import Squat
from hopping_leg.deploy.stop_reasons import Reason
from hopping_leg.deploy.supervisor import State
from hopping_leg.errors import ControllerError
from hopping_leg.flight_recording import recover
from hopping_leg.robot import kinematics, load_robot, shipped_robots
from tests.deploy.fakes import LEG, POSES, FakeClock, FakeLink, Still, make_loop


def run(tmp_path, *args, **kwargs):
    loop, link, box = make_loop(tmp_path, *args, **kwargs)
    outcome = loop.run()
    box.close()
    return outcome, link, recover(box.path)


def states(trace):
    return [event["state"] for event in trace.header["events"] if "state" in event]


def test_a_run_rises_hops_sinks_brakes_and_stops(tmp_path):
    outcome, link, trace = run(tmp_path)
    assert states(trace) == ["arming", "running", "damping", "stopped"]
    assert outcome.supervisor.state is State.STOPPED
    assert outcome.supervisor.stop_cause.reason is Reason.FINISHED
    parts = trace.column("part")
    order = [int(parts[0]), *(int(b) for a, b in itertools.pairwise(parts) if a != b)]
    whole = [part for part in Part if part is not Part.SQUAT]
    assert order[: order.index(Part.DONE) + 1] == whole
    settled = parts == Part.SETTLE
    for joint, target in zip(("hip", "knee"), POSES.start, strict=True):
        angle = trace.column(f"{joint}_position_rad")[settled]
        assert angle[-1] == pytest.approx(target, abs=0.1)
    assert link.told[-10:] == [STOP] * 10
    np.testing.assert_allclose(np.diff(trace.column("time_s")), 0.005, atol=1e-9)


def test_torques_leave_only_in_between_and_never_beyond_the_limit(tmp_path):
    _, link, trace = run(tmp_path, Still((500.0, -500.0)))
    torques = np.array([out.torque for out in link.told])
    assert np.abs(torques).max(axis=0) == pytest.approx([10.0, 20.0])
    quiet = trace.column("state") != State.RUNNING
    assert not trace.column("hip_sent_nm")[quiet].any()
    assert {out.action for out in link.told} == set(Action)


@pytest.mark.parametrize(("tick", "reason"), [(0, Reason.NONE), (60, Reason.OPERATOR_STOP)])
def test_an_operator_may_stop_before_and_after_arming(tmp_path, tick, reason):
    loop, link, box = make_loop(tmp_path)
    link.alter = lambda now, _, reply: (loop.stop() if now == tick else None) or reply
    outcome = loop.run()
    box.close()
    assert outcome.supervisor.state is State.STOPPED
    assert outcome.supervisor.stop_cause.reason is reason
    assert link.told[-1] == STOP
    assert (BRAKE in link.told) is (tick > 0)


def raiser(error):
    def fail():
        raise error

    return fail


LOST = Reason.CONTROLLER_FAILED
FAILURES = [
    ("act", raiser(ArithmeticError("lost")), LOST, "ArithmeticError: lost"),
    ("act", raiser(SystemExit()), LOST, "SystemExit"),
    ("act", lambda: np.array([[math.nan, 0.0]]), Reason.TORQUE_NOT_FINITE, None),
    ("reset", raiser(SystemExit("bye")), LOST, "SystemExit: bye"),
    ("internals", raiser(ArithmeticError("lost")), LOST, "ArithmeticError: lost"),
    ("internals", raiser(KeyboardInterrupt()), LOST, "KeyboardInterrupt"),
    ("internals", lambda: {"other": np.zeros(1)}, LOST, "controller 'still' names ['other']"),
    ("internals", lambda: {"calls": np.array(["many"])}, LOST, "ValueError"),
    ("internals", lambda: None, LOST, "TypeError"),
]


@pytest.mark.parametrize(("method", "does", "reason", "says"), FAILURES)
def test_a_controller_that_fails_brakes_the_leg_and_its_words_are_kept(
    tmp_path, method, does, reason, says
):
    controller = Still()
    loop, link, box = make_loop(tmp_path, controller)
    healthy = getattr(controller, method)

    def fails(*given):
        return does() if controller.calls >= 10 or method == "reset" else healthy(*given)

    setattr(controller, method, fails)
    outcome = loop.run()
    box.close()
    trace = recover(box.path)
    assert outcome.supervisor.stop_cause.reason is reason
    events = trace.header["events"]
    said = [event["controller_error"] for event in events if "controller_error" in event]
    assert [says in words for words in said] == [True] * (says is not None)
    assert all(0 <= event["time_s"] <= trace.column("time_s")[-1] for event in events)
    assert np.isfinite([out.torque for out in link.told]).all()
    assert BRAKE in link.told
    assert link.told[-1] == STOP


def test_a_controller_may_not_name_a_column_of_the_loop(tmp_path):
    controller = Still()
    controller.internals = lambda: {"hip_mode": np.zeros(1)}
    with pytest.raises(ControllerError, match="'hip_mode', which every run has"):
        columns(controller)


@pytest.mark.parametrize(("each", "reason"), [(0.012, Reason.CONTROLLER_SLOW), (0.0, None)])
def test_a_loop_whose_every_second_tick_is_late_is_stopped_by_name(tmp_path, each, reason):
    clock, controller = FakeClock(), Still()
    act = controller.act

    def slow(measurement):
        clock.time += each if controller.calls % 2 else 0.0
        return act(measurement)

    controller.act = slow
    outcome, _, _ = run(tmp_path, controller, link=FakeLink(clock))
    assert outcome.supervisor.stop_cause.reason is (reason or Reason.FINISHED)
    assert outcome.skipped <= 10


@pytest.mark.parametrize(("late", "skipped", "tripped"), [(0.018, 2, True), (0.1, 19, False)])
def test_a_stalled_loop_skips_ticks_and_stops_and_is_not_called_the_drives_timeout(
    tmp_path, late, skipped, tripped
):
    clock = FakeClock()
    clock.hiccups = {round(100.005 + 0.005 * 150, 4): late}
    link, timeout = FakeLink(clock), int(DriveMode.TIMEOUT)
    if tripped:
        link.alter = lambda tick, _, reply: replace(reply, mode=timeout) if tick == 150 else reply
    outcome, _, trace = run(tmp_path, link=link)
    cause = outcome.supervisor.stop_cause
    assert cause.reason is Reason.LOOP_STALLED
    told = f"watchdog tripped, {1e3 * late:.1f} ms late; end other programs"
    assert not tripped or told in str(cause)
    assert outcome.skipped == skipped
    assert np.diff(trace.column("time_s")).max() == pytest.approx(0.005 * (skipped + 1))


def test_a_silent_drive_ends_the_run_and_the_loop_keeps_its_pace(tmp_path):
    clock = FakeClock()
    link = FakeLink(clock, lambda tick, joint, reply: None if joint and tick > 100 else reply)
    outcome, link, trace = run(tmp_path, link=link)
    assert outcome.supervisor.stop_cause.reason is Reason.REPLIES_MISSING
    assert outcome.skipped == 0
    braked = trace.column("time_s")[trace.column("state") == State.DAMPING][0]
    lost = trace.column("time_s")[trace.column("knee_fresh") == 0][0]
    assert braked - lost == pytest.approx(0.015)
    assert np.isnan(trace.column("knee_position_rad")[-1])


def test_a_lost_reply_shows_the_controller_an_older_sample_with_its_age(tmp_path):
    clock, controller = FakeClock(), Still()
    link = FakeLink(clock, lambda tick, joint, reply: None if joint and tick == 120 else reply)
    outcome, _, trace = run(tmp_path, controller, link=link)
    assert outcome.supervisor.stop_cause.reason is Reason.FINISHED
    ages = np.array(controller.ages)
    first = np.flatnonzero(ages[:, 0] > 0)
    assert len(first) == 1
    np.testing.assert_allclose(ages[first[0]], [0.005, 0.010, 0.015])
    np.testing.assert_allclose(ages[first[0] + 1], [0.0, 0.010, 0.015])
    assert trace.column("knee_fresh")[120] == 0


def test_soft_limits_pull_a_joint_back(tmp_path):
    outcome, _, trace = run(tmp_path, Still((0.6, 0.0)))
    hopping = trace.column("part") == Part.HOP
    angle, sent = trace.column("hip_position_rad")[hopping], trace.column("hip_sent_nm")[hopping]
    outside = angle > LEG.hip.upper
    assert outside.any()
    assert (sent[outside] < 0.6).all()
    assert (sent[~outside] == 0.6).all()
    assert outcome.supervisor.stop_cause.reason is Reason.FINISHED


def test_a_crash_of_the_loop_itself_brakes(tmp_path):
    loop, link, box = make_loop(tmp_path)
    link.exchange = lambda outgoing, until: 1 / 0
    with pytest.raises(ZeroDivisionError):
        loop.run()
    box.close()
    assert link.told == [BRAKE]


def sample(position):
    return Reply(position, 10 * position, 0.0, 10, 0, 24.0, 30.0, 0.0)


def test_a_late_reply_is_put_where_it_belongs():
    samples = SampleBuffer(0.005)
    for tick in range(5):
        samples.put(tick, 0, sample(tick))
        if tick != 3:
            samples.put(tick, 1, sample(-tick))
    seen = samples.measurement(4, 0.3)
    np.testing.assert_allclose(seen.age[0], [0, 0.010, 0.015])
    np.testing.assert_allclose(seen.q[0, :, 0], [4, 2, 1])
    samples.put(3, 1, sample(-3))
    seen = samples.measurement(5, 0.25)
    np.testing.assert_allclose(seen.age[0], [0.005, 0.010, 0.015])
    np.testing.assert_allclose(seen.q[0], [[4, -4], [3, -3], [2, -2]])
    np.testing.assert_allclose(seen.qd, 10 * seen.q)
    np.testing.assert_allclose(seen.command[0], [0.3, 0.25, 0.25])


def test_one_sample_stands_for_the_past_and_there_is_none_without_both_joints():
    samples = SampleBuffer(0.005)
    assert samples.measurement(0, 0.3) is None
    samples.put(0, 0, sample(1))
    assert samples.measurement(0, 0.3) is None
    samples.put(0, 1, sample(2))
    seen = samples.measurement(0, 0.3)
    assert seen.q.shape == seen.qd.shape == (1, 3, 2)
    np.testing.assert_allclose(seen.q[0], [[1, 2]] * 3)


@given(st.integers(1, 3000), st.floats(0, 1e6))
def test_a_hop_of_some_ticks_lasts_so_many_wherever_time_began(ticks, began):
    timing = SequenceTiming(hop=ticks / 200, rise=0.4, squat=0.2, settle=0.1)
    times = began + np.arange(ticks + 240) * 0.005 - began
    assert [timing.phase(time)[0] for time in times].count(Part.HOP) == ticks


@pytest.mark.parametrize("name", [n for n in shipped_robots() if load_robot(n).kind == "leg"])
def test_poses_lie_within_the_soft_limits_with_the_foot_below_the_hip(name):
    robot = load_robot(name)
    poses = hopping_poses(robot)
    squat = Squat(robot, poses.start, JointGains(), 0.8)
    assert poses.start[1] + squat.bend >= robot.knee.lower
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


def test_what_is_not_permitted_or_not_there_is_a_notice(monkeypatch):
    monkeypatch.setattr(os, "sched_setscheduler", Mock(side_effect=PermissionError))
    assert "SCHED_FIFO" in realtime.prefer_this_process()
    monkeypatch.delattr(os, "sched_setscheduler")  # as on macOS
    with realtime.keeping_time() as notices:
        assert "SCHED_FIFO" in "".join(notices)


def test_processors_are_told_to_stay_awake_as_long_as_the_loop_runs(tmp_path, monkeypatch):
    told = tmp_path / "latency"
    told.write_bytes(b"")
    monkeypatch.setattr(realtime, "_LATENCY", told)
    with realtime.processors_awake() as notice:
        assert notice is None
        assert told.read_bytes() == bytes(4)
    monkeypatch.setattr(realtime, "_LATENCY", tmp_path)
    with realtime.processors_awake() as notice:
        assert "No permission to keep the processors awake" in notice
    monkeypatch.setattr(realtime, "_LATENCY", tmp_path / "none")
    with realtime.processors_awake() as notice:
        assert notice is None


def test_a_controller_that_changes_what_it_is_given_changes_nothing_else(tmp_path):
    class Changing(Still):
        def act(self, measurement):
            asked = super().act(measurement)
            measurement.q[:] = measurement.qd[:] = 9.0
            return asked

    traces = []
    for name, controller in (("plain", Still((0.5, 0.5))), ("changing", Changing((0.5, 0.5)))):
        _, link, _ = run(tmp_path / name, controller)
        traces.append([told.torque for told in link.told])
    assert traces[0] == traces[1]
