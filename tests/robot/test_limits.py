import dataclasses

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hopping_leg.robot import (
    OVERSPEED,
    MotorLimit,
    SoftLimiter,
    SoftLimits,
    braking_times,
    dynamics,
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


@given(st.floats(0, 1), st.floats(0, 1), pairs, pairs)
def test_soft_limits_leave_torques_inside_the_limits_alone(hip, knee, torque, qd):
    lower, upper = ROBOT.of_joints("lower"), ROBOT.of_joints("upper")
    q = lower + np.array([hip, knee]) * (upper - lower)
    np.testing.assert_array_equal(SoftLimiter(ROBOT, SoftLimits()).added(torque, q, qd), 0)


@pytest.mark.parametrize(("side", "sign"), [("lower", 1), ("upper", -1)])
@pytest.mark.parametrize("replace", [False, True])
def test_soft_limits_pull_back_inside(side, sign, replace):
    q = ROBOT.of_joints(side) - sign * 0.1
    soft = SoftLimits(stiffness=20.0, damping=0.0, replace=replace)
    added = SoftLimiter(ROBOT, soft).added(np.ones(2), q, np.zeros(2))
    np.testing.assert_allclose(added, sign * 2.0 - replace)


@pytest.mark.parametrize("late", [0, 1])
@pytest.mark.parametrize("joint", [0, 1])
@pytest.mark.parametrize("name", ["legv1", "legv2", "legv2-paper"])
def test_soft_limits_do_not_ring_on_a_late_sample(name, joint, late):
    robot, period = load_robot(name), 0.005
    bounds = {"lower": 0.0, "upper": 0.0}  # outside on both sides
    hip, knee = (dataclasses.replace(j, **bounds) for j in (robot.hip, robot.knee))
    limiter = SoftLimiter(dataclasses.replace(robot, hip=hip, knee=knee), SoftLimits())
    mobility = np.linalg.inv(dynamics.mass_matrix(robot, np.array([0.5, -1.2])))
    damping = (robot.hip, robot.knee)[joint].damping
    q, qd, samples = 0.1, 0.0, [(0.1, 0.0)] * (late + 1)
    for _ in range(100):
        seen = (np.eye(2)[joint] * value for value in samples[-1 - late])
        torque = limiter.added(np.zeros(2), *seen)[joint]
        for _ in range(50):
            qd += period / 50 * (torque - damping * qd) * mobility[joint + 1, joint + 1]
            q += period / 50 * qd
        samples.append((q, qd))
    angle = np.array(samples)[:, 0]
    turns = np.flatnonzero(np.diff(np.sign(np.diff(angle)))) + 1
    swings = np.abs(angle[turns])
    swings = swings[swings > 1e-3]
    assert (swings[1:] < 0.57 * swings[:-1]).all()  # what a damping ratio of 0.18 leaves
    assert abs(angle[-1]) < 5e-3


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
