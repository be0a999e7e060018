import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hopping_leg.controllers import RolloutConfig, rollout
from hopping_leg.controllers.registry import load_controller, robot_of
from hopping_leg.deploy.drive_link import Action, DriveMode, Reply
from hopping_leg.deploy.safety_limits import hopping_limits, recording_limits
from hopping_leg.deploy.stop_reasons import Counts, Operator, Reason, SupervisorInput, find_cause
from hopping_leg.deploy.supervisor import State, SupervisorState, supervise
from hopping_leg.robot import JOINTS, load_robot
from hopping_leg.sim import NO_NOISE

LEG = load_robot("legv2")
LIMITS = hopping_limits(LEG, 200.0)
PERIOD = LIMITS.period

ANYTHING = st.floats(allow_nan=True, allow_infinity=True)
NUMBERS = st.floats(-30, 30) | ANYTHING
REPLIES = st.builds(
    Reply,
    **dict.fromkeys(("position", "velocity", "torque", "taken"), NUMBERS),
    mode=st.sampled_from([0, 1, 2, 3, 4, 10, 10, 10, 11, 12, 15]),
    fault=st.integers(0, 105),
    voltage=st.just(24.0) | NUMBERS,
    temperature=st.just(30.0) | NUMBERS,
)
OBSERVATIONS = st.builds(
    SupervisorInput,
    time=st.floats(0, 100), late=st.just(0.0) | ANYTHING,
    replies=st.tuples(st.none() | REPLIES, st.none() | REPLIES),
    wanted=st.none() | st.tuples(NUMBERS, NUMBERS), operator=st.sampled_from(Operator),
    finished=st.booleans(),
)  # fmt: skip


def good(index=0, **changes):
    reply = Reply((0.7, -1.4)[index], 0.0, 0.0, int(DriveMode.POSITION), 0, 24.0, 30.0, 0.0)
    return replace(reply, **changes)


def seen(tick, **changes):
    replies = (good(0, taken=tick * PERIOD), good(1, taken=tick * PERIOD))
    return replace(SupervisorInput(tick * PERIOD, 0.0, replies, (0.1, 0.2)), **changes)


def running():
    memory, _ = supervise(LIMITS, SupervisorState(), seen(0, operator=Operator.ARM))
    memory, out = supervise(LIMITS, memory, seen(1))
    assert memory.state is State.RUNNING
    assert out.torque == (0.1, 0.2)
    return memory


@given(st.lists(OBSERVATIONS, min_size=1, max_size=30), st.booleans())
def test_whatever_is_seen_what_leaves_is_finite_and_within_limits(course, already_running):
    memory = running() if already_running else SupervisorState()
    for observation in course:
        before = memory
        memory, out = supervise(LIMITS, before, observation)
        for torque, limit in zip(out.torque, LIMITS.torque, strict=True):
            assert math.isfinite(torque)
            assert abs(torque) <= limit
        if out.torque != (0.0, 0.0):
            assert memory.state is State.RUNNING
        if memory.state is not before.state:
            assert memory.cause.reason is not Reason.NONE
            assert str(memory.cause)


@given(st.lists(OBSERVATIONS, min_size=1, max_size=30), st.sampled_from([3, 4]))
def test_a_stop_is_latched_until_the_operator_arms(course, state):
    memory = SupervisorState(State(state), 0.0)
    for observation in course:
        asked = Operator.STOP if observation.operator is Operator.ARM else Operator.NOTHING
        memory, out = supervise(LIMITS, memory, replace(observation, operator=asked))
        assert memory.state in (State.DAMPING, State.STOPPED)
        assert out.action is not Action.TORQUE


@given(OBSERVATIONS)
def test_nothing_but_the_operator_arms(observation):
    memory, out = supervise(LIMITS, SupervisorState(), observation)
    if observation.operator is Operator.ARM:
        assert memory.state is State.ARMING
        assert out.torque == (0.0, 0.0)
    else:
        stopped = observation.operator is Operator.STOP
        assert memory.state is (State.STOPPED if stopped else State.DISARMED)
        assert out.action is Action.STOP


def at(tick, index, **changes):
    replies = list(seen(tick).replies)
    replies[index] = replace(replies[index], **changes)
    return seen(tick, replies=tuple(replies))


@pytest.mark.parametrize(
    ("observation", "reason", "detail"),
    [
        (seen(2, operator=Operator.STOP), Reason.OPERATOR_STOP, ""),
        (at(2, 1, mode=1, fault=35), Reason.DRIVE_FAULT, "knee: fault 35 (encoder)"),
        (at(2, 0, mode=11), Reason.DRIVE_TIMEOUT, "hip"),
        (at(2, 0, mode=0), Reason.DRIVE_LEFT_MODE, "mode 0"),
        (at(2, 0, velocity=math.nan), Reason.MEASUREMENT_NOT_FINITE, "nan rad/s"),
        (at(2, 0, position=1.0), Reason.ENCODER_JUMP, "0.3 rad off"),
        (seen(2, replies=(good(0, mode=11), good(1, mode=1, fault=35))), Reason.DRIVE_FAULT, "35"),
        (at(2, 0, velocity=60.0, position=0.75), Reason.SPEED_LIMIT, "60 rad/s"),
        (at(2, 1, temperature=70.0), Reason.TOO_HOT, "70 deg C"),
        (at(2, 1, temperature=math.nan), Reason.TOO_HOT, "nan"),
        (at(2, 1, voltage=10.0), Reason.VOLTAGE_LOW, "10.0 V"),
        (at(2, 1, voltage=45.0), Reason.VOLTAGE_HIGH, "45.0 V"),
        (seen(2, late=0.05), Reason.LOOP_STALLED, "50.0 ms"),
        (seen(2, wanted=None), Reason.CONTROLLER_FAILED, ""),
        (seen(2, wanted=(math.inf, 0.0)), Reason.TORQUE_NOT_FINITE, "inf"),
        (seen(2, trouble="by the file"), Reason.STANDS_WRONG, "by the file"),
        (seen(2, finished=True), Reason.FINISHED, ""),
    ],
)
def test_each_cause_damps_within_the_tick_and_says_why(observation, reason, detail):
    memory, out = supervise(LIMITS, running(), observation)
    assert memory.state is State.DAMPING
    assert memory.cause.reason is reason
    assert detail in str(memory.cause)
    assert out.action is Action.BRAKE


@pytest.mark.parametrize("rate", [0.1, 0.4, -0.4, 2.5, 5, 20])
def test_a_position_that_drifts_from_its_velocity_is_caught(rate):
    memory, tick, caught = running(), 0, rate != 0.1
    for tick in range(2, 1000):
        swing = 0.3 * math.sin(20 * tick * PERIOD), 6.0 * math.cos(20 * tick * PERIOD)
        angle = 0.7 + swing[0] + rate * (tick - 1) * PERIOD
        memory, _ = supervise(LIMITS, memory, at(tick, 0, position=angle, velocity=swing[1]))
        if memory.state is not State.RUNNING:
            break
    drifts = {Reason.ENCODER_DRIFT, Reason.VELOCITY_FALSE}
    assert (memory.cause is not None and memory.cause.reason in drifts) is caught
    assert not caught or abs(rate * (tick - 1) * PERIOD) < 0.45


def test_a_joint_that_drifts_out_of_its_range_is_caught():
    memory, angle, tick = running(), 0.7, 2
    while memory.state is State.RUNNING:
        angle, tick = angle + 0.02, tick + 1
        memory, _ = supervise(LIMITS, memory, at(tick, 0, position=angle, velocity=4.0))
    assert memory.cause.reason is Reason.POSITION_LIMIT
    assert angle == pytest.approx(LIMITS.upper[0] - 4.0 * LIMITS.braking[0], abs=0.021)


@pytest.mark.parametrize(
    ("side", "index"), [("lower", 1), ("upper", 1), ("lower", 0), ("upper", 0)]
)
def test_a_joint_is_braked_earlier_the_faster_it_nears_a_stop(side, index):
    stop, sign = getattr(LIMITS, side)[index], -1 if side == "lower" else 1

    def found(speed, before):
        reply = good(index, position=stop - sign * before, velocity=sign * speed, taken=2 * PERIOD)
        replies = tuple(reply if i == index else good(i, taken=2 * PERIOD) for i in range(2))
        return find_cause(LIMITS, Counts(), Counts(), seen(2, replies=replies), arming=False)

    for speed in (0.0, 5.0, 20.0):
        margin = LIMITS.braking[index] * speed
        assert found(speed, margin + 0.01) is None
        assert found(speed, margin - 0.01).reason is Reason.POSITION_LIMIT
    assert found(-20.0, 0.01) is None  # on its way back


@pytest.mark.parametrize(
    ("replies", "late", "reason", "tolerated"),
    [
        ((None, good(1)), 0.0, Reason.REPLIES_MISSING, LIMITS.missing_ticks),
        ((good(0), good(1)), 0.007, Reason.LOOP_OVERRUN, LIMITS.overrun_ticks),
        ((good(0), good(1, torque=32.0)), 0.0, Reason.TORQUE_LIMIT, LIMITS.excess_ticks),
    ],
)
def test_single_faults_are_tolerated_rows_of_them_are_not(replies, late, reason, tolerated):
    memory, _ = supervise(LIMITS, running(), at(1, 0, fault=98))  # a notice is no fault
    for tick in range(2, 2 + tolerated):
        memory, _ = supervise(LIMITS, memory, seen(tick, replies=replies, late=late))
        assert memory.state is State.RUNNING
    again, _ = supervise(LIMITS, memory, seen(2 + tolerated))
    assert again.state is State.RUNNING
    memory, _ = supervise(LIMITS, memory, seen(2 + tolerated, replies=replies, late=late))
    assert memory.cause.reason is reason


def test_arming_waits_for_both_drives_but_not_for_ever():
    memory, _ = supervise(LIMITS, SupervisorState(), seen(0, operator=Operator.ARM))
    for tick in range(1, 90):
        memory, out = supervise(LIMITS, memory, at(tick, 1, mode=2))
        assert memory.state is State.ARMING
        assert out.torque == (0.0, 0.0)
    for tick in range(90, 110):
        memory, _ = supervise(LIMITS, memory, at(tick, 1, mode=2))
    assert memory.state is State.DAMPING
    assert memory.cause.reason is Reason.ARMING_TOOK_TOO_LONG


def test_damping_ends_at_rest_or_after_its_time_and_trusts_no_dead_encoder():
    stop, false, rest = Reason.OPERATOR_STOP, Reason.VELOCITY_FALSE, Reason.CAME_TO_REST
    for speed, noise, why in (0, 1e-6, stop), (3, 1e-6, stop), (0, 0, stop), (0, 1e-6, false):
        reason = rest if (speed, noise, why) == (0, 1e-6, stop) else Reason.DAMPED_LONG_ENOUGH
        memory, _ = supervise(LIMITS, running(), seen(2, operator=Operator.STOP))
        memory = replace(memory, stop_cause=replace(memory.stop_cause, reason=why))
        tick = 3
        while memory.state is State.DAMPING:
            replies = [
                replace(reply, position=reply.position + tick % 2 * noise, velocity=speed, mode=15)
                for reply in seen(tick).replies
            ]
            memory, _ = supervise(LIMITS, memory, seen(tick, replies=tuple(replies)))
            tick += 1
        assert memory.cause.reason is reason
        assert memory.stop_cause.reason is why
        memory, _ = supervise(LIMITS, memory, seen(tick, operator=Operator.ARM))
        assert memory.state is State.ARMING


def test_the_manual_explains_every_message():
    page = (Path(__file__).parents[2] / "docs" / "supervisor.md").read_text(encoding="utf-8")
    for reason in Reason:
        assert f"| {reason.sentence} |" in page


PAPER_LEG = load_robot("legv2-paper")


@pytest.mark.parametrize("name", ["fast", "energy-shaping"])
def test_who_hops_as_trained_is_not_stopped_for_it(name):
    leg = load_robot(robot_of([name]))
    limits = hopping_limits(leg, 200.0)
    commands = np.tile([0.25, 0.30, 0.35], (800, 1))
    run = rollout(
        load_controller(name, leg), RolloutConfig(leg, NO_NOISE, threads=1), commands, seed=0
    )
    sides = zip(JOINTS, limits.lower, limits.upper, limits.braking, strict=True)
    for joint, lower, upper, braking in sides:
        angle, speed = (run.data[f"{joint}_{what}"] for what in ("position_rad", "velocity_rad_s"))
        ahead = angle + braking * speed
        assert lower < min(angle.min(), ahead.min())
        assert max(angle.max(), ahead.max()) < upper


def test_no_leg_may_go_where_its_mechanism_ends():
    limits, recording = hopping_limits(PAPER_LEG, 200.0), recording_limits(PAPER_LEG, 200.0)
    stops = [(joint.stop_lower, joint.stop_upper) for joint in (PAPER_LEG.hip, PAPER_LEG.knee)]
    assert list(zip(limits.lower, limits.upper, strict=True)) == stops
    for index in range(2):
        assert recording.lower[index] < limits.lower[index]
        assert limits.upper[index] < recording.upper[index]
    assert recording.braking == (0.0, 0.0)
    for joint, (low, high), stop in zip(
        (PAPER_LEG.hip, PAPER_LEG.knee), limits.start, stops, strict=True
    ):
        assert stop[0] <= low < joint.lower < joint.upper < high <= stop[1]
