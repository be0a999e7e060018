import mujoco
import numpy as np
import pytest

from hopping_leg.robot import GRAVITY, build_model, load_robot, shipped_robots


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
