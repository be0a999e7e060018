import dataclasses

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hopping_leg.robot import (
    GRAVITY,
    OVERSPEED,
    MotorLimit,
    braking_times,
    build_model,
    get_spec,
    load_robot,
    shipped_robots,
)


@pytest.mark.parametrize("name", shipped_robots())
def test_the_model_holds_the_parameters(name):
    robot = load_robot(name)
    model = build_model(robot)
    assert model.body_mass.sum() == pytest.approx(robot.mass)
    np.testing.assert_allclose(model.dof_armature[1:], robot.of_joints("armature"))
    np.testing.assert_allclose(model.dof_frictionloss[0], robot.rail.friction)
    np.testing.assert_allclose(model.dof_frictionloss[1:], robot.of_joints("friction"))
    np.testing.assert_allclose(
        model.dof_damping[1:].reshape(2, -1)[:, 0], robot.of_joints("damping")
    )
    np.testing.assert_allclose(
        model.geom("floor").solref, [robot.contact.time_constant, robot.contact.damping_ratio]
    )
    assert -model.opt.gravity[2] == GRAVITY


def test_the_knee_feels_the_belt():
    model = build_model(load_robot("legv2"))
    data = mujoco.MjData(model)
    data.ctrl[:] = 1.0
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.qfrc_actuator, [0, 1, 2])


@pytest.mark.parametrize("part", ["base", "knee_cap", "foot"])
def test_base_knee_and_foot_touch_the_ground(part):
    model = build_model(load_robot("legv2"))
    data = mujoco.MjData(model)
    posture = {"base": [0.03, np.pi, 0], "knee_cap": [0.15, 0, -np.pi + 0.3], "foot": [0.29, 0, 0]}
    data.qpos[:] = posture[part]
    mujoco.mj_forward(model, data)
    touching = {model.geom(g).name for contact in data.contact[: data.ncon] for g in contact.geom}
    assert touching == {"floor", part}


def fixed_base(name, gravity=GRAVITY):
    """Return the model and data of a leg whose base is fixed, knee bent, at rest."""
    robot = load_robot(name)
    spec = get_spec(robot, fixed_base=True)
    spec.option.gravity = [0, 0, -gravity]
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[:] = [0.3, -1.2]
    return robot, model, data


@pytest.mark.parametrize("joint", [0, 1])
@pytest.mark.parametrize("name", shipped_robots())
def test_dry_friction_holds_a_joint_up_to_its_size(name, joint):
    for share, holds in ((0.9, True), (1.1, False)):
        robot, model, data = fixed_base(name, gravity=1e-9)
        data.qfrc_applied[joint] = share * robot.of_joints("friction")[joint]
        speeds = []
        for _ in range(4000):
            mujoco.mj_step(model, data)
            speeds.append(abs(data.qvel[joint]))
        assert (max(speeds) < 1e-4) == holds
        assert holds or speeds[-1] > 1e-3


@pytest.mark.parametrize("name", shipped_robots())
def test_dry_friction_holds_the_rail(name):
    robot = load_robot(name)
    for share in (0.9, 1.1) if robot.rail.friction else ():
        model = build_model(robot)
        data = mujoco.MjData(model)
        data.qpos[:] = [1.0, 0.0, 0.0]
        data.qfrc_applied[0] = robot.mass * GRAVITY + share * robot.rail.friction
        mujoco.mj_step(model, data, 4000)
        assert (data.qvel[0] < 1e-4) == (share < 1)


@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize("joint", [0, 1])
@pytest.mark.parametrize("name", shipped_robots())
def test_a_leg_driven_into_a_stop_stays_within_milliradians_of_it(name, joint, side):
    robot, model, data = fixed_base(name, gravity=1e-9)
    stop = robot.of_joints("stop_lower" if side < 0 else "stop_upper")[joint]
    data.qpos[joint] = stop - side * 0.05
    data.ctrl[joint] = side * 1.0
    mujoco.mj_step(model, data, 8000)
    assert abs(data.qpos[joint] - stop) < 5e-3
    assert abs(data.qvel[joint]) < 1e-2


def test_a_leg_on_a_fixed_base_touches_nothing():
    _, model, data = fixed_base("legv2-paper")
    mujoco.mj_step(model, data, 100)
    assert model.nv == 2
    assert data.ncon == 0


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
def test_a_motors_gain_acts_on_what_its_limits_let_through(torque, qd):
    knee = dataclasses.replace(ROBOT.knee, torque_gain=0.9)
    weak = MotorLimit(dataclasses.replace(ROBOT, knee=knee))
    within = MOTORS.clip(torque, qd)
    np.testing.assert_array_equal(MOTORS.give(torque, qd), within)
    np.testing.assert_array_equal(weak.give(torque, qd), within * [1.0, 0.9])


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
