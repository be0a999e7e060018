import dataclasses

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hopping_leg.robot import (
    OVERSPEED,
    MotorLimit,
    braking_times,
    get_spec,
    load_robot,
)

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


@pytest.mark.parametrize("share", [0.1, 0.5, OVERSPEED])
@pytest.mark.parametrize("joint", [0, 1])
@pytest.mark.parametrize("name", ["legv1", "legv2", "legv2-paper"])
def test_shorted_windings_brake_a_joint_before_its_stop(name, joint, share):
    robot, rate = load_robot(name), 200.0
    model = get_spec(robot, fixed_base=True).compile()
    model.opt.gravity[:] = 0
    data = mujoco.MjData(model)
    speed, stop = (robot.of_joints(x)[joint] for x in ("no_load_speed", "stop_upper"))
    speed *= share
    data.qpos[joint] = stop - speed * braking_times(robot, rate)[joint]
    data.qvel[joint] = speed
    motor = (robot.hip, robot.knee)[joint]
    slope = motor.motor.peak_torque * motor.belt_ratio / motor.no_load_speed
    nearest = stop
    while data.qvel[joint] > 0.01:
        if data.time >= 1 / rate:
            data.qfrc_applied[joint] = -slope * data.qvel[joint]
        mujoco.mj_step(model, data)
        nearest = min(nearest, stop - data.qpos[joint])
    assert nearest > 0
