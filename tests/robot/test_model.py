import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hopping_leg.deploy.safety_limits import hopping_limits
from hopping_leg.robot import MotorLimit, get_spec, limits, load_robot, shipped_robots


@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize("joint", [0, 1])
@pytest.mark.parametrize("name", shipped_robots())
def test_a_leg_driven_into_a_stop_stays_within_milliradians_of_it(name, joint, side):
    robot = load_robot(name)
    model = get_spec(robot, fixed_base=True).compile()
    model.opt.gravity[:] = 0
    data = mujoco.MjData(model)
    data.qpos[:] = [0.3, -1.2]
    stop = robot.of_joints("stop_lower" if side < 0 else "stop_upper")[joint]
    data.qpos[joint] = stop - side * 0.05
    data.ctrl[joint] = side * 1.0
    mujoco.mj_step(model, data, 8000)
    assert abs(data.qpos[joint] - stop) < 5e-3
    assert abs(data.qvel[joint]) < 1e-2


ROBOT = load_robot("legv2")
MOTORS = MotorLimit(ROBOT)
finite = st.floats(-100, 100)
pairs = st.tuples(finite, finite).map(np.array)


@given(pairs, pairs)
def test_a_motor_keeps_its_limits_whatever_it_is_asked_for_in_either_direction(torque, qd):
    given_torque = MOTORS.clip(torque, qd)
    assert (np.abs(given_torque) <= MOTORS.limit).all()
    assert (given_torque * torque >= 0).all()
    assert (np.abs(given_torque) <= np.abs(torque)).all()
    beyond = np.abs(qd) >= ROBOT.of_joints("no_load_speed")
    assert (given_torque[beyond & (torque * qd > 0)] == 0).all(), "it does not drive any faster"
    np.testing.assert_array_equal(MOTORS.clip(-torque, -qd), -given_torque)


@given(pairs, pairs)
def test_the_supervisor_knows_the_motors_by_the_same_line(torque, qd):
    lines = hopping_limits(ROBOT, 200.0).motors
    shares = [m.share(*seen) for m, seen in zip(lines, zip(torque, qd, strict=True), strict=True)]
    np.testing.assert_allclose(shares * MOTORS.limit, MOTORS.clip(torque, qd), atol=1e-9)


@pytest.mark.parametrize("share", [0.1, 0.5, limits.OVERSPEED])
@pytest.mark.parametrize("joint", [0, 1])
@pytest.mark.parametrize("name", ["legv1", "legv2", "legv2-paper"])
def test_shorted_windings_brake_a_joint_before_its_stop(name, joint, share):
    robot, rate = load_robot(name), 200.0
    model = get_spec(robot, fixed_base=True).compile()
    model.opt.gravity[:] = 0
    data = mujoco.MjData(model)
    speed, stop = (robot.of_joints(x)[joint] for x in ("no_load_speed", "stop_upper"))
    speed *= share
    data.qpos[joint] = stop - speed * limits.braking_times(robot, rate)[joint]
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
