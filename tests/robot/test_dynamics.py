import mujoco
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from hopping_leg.robot import build_model, dynamics, kinematics, load_robot
from tests.robot.legs import SEEDS, posed, random_robot, random_state


@settings(max_examples=40)
@given(SEEDS)
def test_dynamics_kinematics_and_clearances_agree_with_mujoco(seed):
    rng = np.random.default_rng(seed)
    robot = random_robot(rng)
    height, rate, q, qd = random_state(rng)
    model = build_model(robot)
    data, (full, jacobian) = posed(model, height, rate, q, qd), np.zeros((2, 3, 3))
    mujoco.mj_fullM(model, data, full)
    np.testing.assert_allclose(dynamics.mass_matrix(robot, q)[0], full, rtol=1e-7, atol=1e-9)
    bias = dynamics.bias_force(robot, q, qd)[0]
    np.testing.assert_allclose(bias, data.qfrc_bias, rtol=1e-7, atol=1e-9)
    still = posed(model, height, 0 * rate, q, 0 * qd)
    gravity = dynamics.gravity_force(robot, q)[0]
    np.testing.assert_allclose(gravity, still.qfrc_bias, rtol=1e-7, atol=1e-9)
    foot = data.site("foot").xpos
    down, forward = kinematics.foot_position(robot, q)[0]
    np.testing.assert_allclose([height[0] - down, forward], foot[[2, 0]], atol=1e-12)
    bottom = {
        "foot": kinematics.foot_clearance(robot, height, q),
        "knee_cap": kinematics.knee_clearance(robot, height, q),
        "base": kinematics.base_clearance(robot, height),
    }
    for name, clearance in bottom.items():
        geom = model.geom(name).id
        gap = mujoco.mj_geomDistance(model, data, model.geom("floor").id, geom, 10.0, None)
        np.testing.assert_allclose(clearance[0], gap, atol=1e-9)
    mujoco.mj_jacSite(model, data, jacobian, None, model.site("foot").id)
    velocity = jacobian @ data.qvel
    rates = kinematics.foot_velocity(robot, q, qd)[0]
    np.testing.assert_allclose([rate[0] - rates[0], rates[1]], velocity[[2, 0]], atol=1e-9)


angles = st.tuples(st.floats(-3.1, 3.1), st.floats(-3.1, -0.02)).map(np.array)


@given(SEEDS, angles)
def test_inverse_kinematics_undoes_forward_kinematics(seed, q):
    robot = random_robot(np.random.default_rng(seed))
    foot = kinematics.foot_position(robot, q)
    if np.linalg.norm(foot) < 1e-3:
        return
    again = kinematics.joint_angles(robot, foot)
    np.testing.assert_allclose(kinematics.foot_position(robot, again), foot, atol=1e-9)
    turns = (again - q) / (2 * np.pi)
    np.testing.assert_allclose(turns, np.round(turns), atol=1e-6)


@given(st.floats(0.2901, 10), st.floats(-np.pi, np.pi))
def test_a_foot_out_of_reach_has_no_angles(distance, direction):
    robot = load_robot("legv2")
    foot = distance * np.array([np.cos(direction), np.sin(direction)])
    assert np.isnan(kinematics.joint_angles(robot, foot)).all()


def test_smooth_step_rate_is_its_derivative():
    s, h = np.linspace(0.05, 0.95, 19), 1e-6
    slope = (kinematics.smooth_step(s + h) - kinematics.smooth_step(s - h)) / (2 * h)
    np.testing.assert_allclose(kinematics.smooth_step_rate(s), slope, rtol=1e-6)
