import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hopping_leg.robot import MotorLimit, SoftLimiter, SoftLimits, load_robot

ROBOT = load_robot("legv2")
MOTORS = MotorLimit(ROBOT)
finite = st.floats(-100, 100)
pairs = st.tuples(finite, finite).map(np.array)


@given(pairs, pairs)
def test_a_motor_never_exceeds_its_limits_nor_turns_the_torque_round(torque, qd):
    given_torque = MOTORS.clip(torque, qd)
    assert (np.abs(given_torque) <= MOTORS.limit).all()
    assert (given_torque * torque >= 0).all()
    assert (np.abs(given_torque) <= np.abs(torque)).all()


@given(pairs, pairs)
def test_a_motor_cannot_drive_beyond_its_no_load_speed(torque, qd):
    beyond = np.abs(qd) >= ROBOT.of_joints("no_load_speed")
    driving = torque * qd > 0
    assert (MOTORS.clip(torque, qd)[beyond & driving] == 0).all()


@given(pairs, pairs)
def test_the_motor_limit_has_no_direction(torque, qd):
    np.testing.assert_array_equal(MOTORS.clip(-torque, -qd), -MOTORS.clip(torque, qd))


@given(pairs, pairs)
def test_a_motors_gain_acts_on_what_its_limits_let_through(torque, qd):
    knee = dataclasses.replace(ROBOT.knee, torque_gain=0.9)
    weak = MotorLimit(dataclasses.replace(ROBOT, knee=knee))
    within = MOTORS.clip(torque, qd)
    np.testing.assert_array_equal(MOTORS.give(torque, qd), within)
    np.testing.assert_array_equal(weak.give(torque, qd), within * [1.0, 0.9])


def test_the_belt_doubles_torque_and_halves_speed():
    assert ROBOT.knee.torque_limit == 2 * ROBOT.knee.motor.torque_limit
    assert ROBOT.knee.no_load_speed == ROBOT.knee.motor.no_load_speed / 2


@given(st.floats(0, 1), st.floats(0, 1), pairs, pairs)
def test_soft_limits_leave_torques_inside_the_limits_alone(hip, knee, torque, qd):
    lower, upper = ROBOT.of_joints("lower"), ROBOT.of_joints("upper")
    q = lower + np.array([hip, knee]) * (upper - lower)
    np.testing.assert_array_equal(SoftLimiter(ROBOT, SoftLimits()).apply(torque, q, qd), torque)


@pytest.mark.parametrize(("side", "sign"), [("lower", 1), ("upper", -1)])
@pytest.mark.parametrize("replace", [False, True])
def test_soft_limits_pull_back_inside(side, sign, replace):
    q = ROBOT.of_joints(side) - sign * 0.1
    soft = SoftLimits(stiffness=20.0, damping=0.0, replace=replace)
    torque = SoftLimiter(ROBOT, soft).apply(np.ones(2), q, np.zeros(2))
    np.testing.assert_allclose(torque, sign * 2.0 + (0 if replace else 1))
