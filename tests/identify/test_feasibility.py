"""Torques are those of MuJoCo's own inverse dynamics, with and without the ground."""

import dataclasses

import mujoco
import numpy as np
import pytest

from hopping_leg.identify.feasibility import inverse_dynamics
from hopping_leg.robot import build_model, kinematics, load_robot

LEG = load_robot("legv2")
HIP, KNEE = (dataclasses.replace(j, friction=0.0, damping=0.0) for j in (LEG.hip, LEG.knee))
ROBOT = dataclasses.replace(LEG, hip=HIP, knee=KNEE)


def mujoco_torque(q, qd, qdd, climb, force):
    """Return generalised forces of a motion less what the ground's force at the foot gives."""
    model = build_model(ROBOT)
    model.geom_contype[:] = 0
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:], data.qacc[:] = [1.0, *q], [0.0, *qd], [climb, *qdd]
    mujoco.mj_inverse(model, data)
    jacobian = np.zeros((3, model.nv))
    mujoco.mj_jacSite(model, data, jacobian, None, model.site("foot").id)
    return data.qfrc_inverse - force * jacobian[2]


@pytest.mark.parametrize("seed", range(8))
def test_a_clamped_base_needs_mujocos_torques(seed):
    q, qd, qdd = np.random.default_rng(seed).normal(size=(3, 2)) * [[1], [5], [50]]
    torque = inverse_dynamics(ROBOT, "fixed-base", q, qd, qdd)
    np.testing.assert_allclose(torque, mujoco_torque(q, qd, qdd, 0.0, 0.0)[1:], atol=1e-8)


@pytest.mark.parametrize("seed", range(12))
def test_a_standing_leg_needs_mujocos_torques_and_the_ground_never_pulls(seed):
    rng = np.random.default_rng(seed)
    q, qd, qdd = (
        np.array([0.7, -1.4]) + rng.normal(size=2) * 0.3,
        *rng.normal(size=(2, 2)) * [[3], [20]],
    )
    torque = inverse_dynamics(ROBOT, "rail", q, qd, qdd)
    step = 1e-4
    height = [
        kinematics.stance_height(ROBOT, q + qd * s + qdd * s**2 / 2) for s in (-step, 0, step)
    ]
    climb = float(np.diff(height, 2)[0] / step**2)
    force = mujoco_torque(q, qd, qdd, climb, 0.0)[0]
    if force < 0:
        free = mujoco_torque(q, qd, qdd, 0.0, 0.0)[0]
        climb, force = -free / ROBOT.mass, 0.0
    expected = mujoco_torque(q, qd, qdd, climb, force)
    assert expected[0] == pytest.approx(0, abs=1e-3)
    np.testing.assert_allclose(torque, expected[1:], atol=1e-3)


def test_friction_and_damping_oppose_the_motion():
    motion = np.array([0.3, -1.0]), np.array([2.0, -3.0]), np.zeros(2)
    real, ideal = (inverse_dynamics(robot, "fixed-base", *motion) for robot in (LEG, ROBOT))
    expected = LEG.of_joints("friction") * [1, -1] + LEG.of_joints("damping") * motion[1]
    np.testing.assert_allclose(real - ideal, expected)
