import mujoco
import numpy as np
import pytest
from hypothesis import given, settings

from hopping_leg.robot import build_model, dynamics, kinematics, load_robot
from tests.robot.legs import SEEDS, random_robot, random_state


def posed(model, height, rate, q, qd):
    data = mujoco.MjData(model)
    data.qpos[:] = [height[0], *q[0]]
    data.qvel[:] = [rate[0], *qd[0]]
    mujoco.mj_forward(model, data)
    return data


@settings(max_examples=40)
@given(SEEDS)
def test_mass_matrix_and_bias_agree_with_mujoco(seed):
    rng = np.random.default_rng(seed)
    robot = random_robot(rng)
    height, rate, q, qd = random_state(rng)
    model = build_model(robot)
    data = posed(model, height, rate, q, qd)
    full = np.zeros((3, 3))
    mujoco.mj_fullM(model, data, full)
    np.testing.assert_allclose(dynamics.mass_matrix(robot, q)[0], full, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(
        dynamics.bias_force(robot, q, qd)[0], data.qfrc_bias, rtol=1e-7, atol=1e-9
    )


@settings(max_examples=20)
@given(SEEDS)
def test_energies_agree_with_mujoco(seed):
    rng = np.random.default_rng(seed)
    robot = random_robot(rng)
    height, rate, q, qd = random_state(rng)
    model = build_model(robot)
    model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    potential, kinetic = posed(model, height, rate, q, qd).energy
    assert dynamics.kinetic_energy(robot, q, rate, qd)[0] == pytest.approx(kinetic, rel=1e-9)
    assert dynamics.potential_energy(robot, height, q)[0] == pytest.approx(potential, rel=1e-9)


@given(SEEDS)
def test_mass_matrix_is_symmetric_and_positive_definite(seed):
    rng = np.random.default_rng(seed)
    matrix = dynamics.mass_matrix(random_robot(rng), rng.uniform(-4, 4, (7, 2)))
    np.testing.assert_array_equal(matrix, np.swapaxes(matrix, -1, -2))
    assert np.linalg.eigvalsh(matrix).min() > 0


@given(SEEDS)
def test_gravity_force_is_the_gradient_of_potential_energy(seed):
    rng = np.random.default_rng(seed)
    robot, step = random_robot(rng), 1e-6
    height, _, q, _ = random_state(rng)
    gradient = [
        dynamics.potential_energy(robot, height + step, q)
        - dynamics.potential_energy(robot, height - step, q)
    ]
    gradient += [
        dynamics.potential_energy(robot, height, q + joint)
        - dynamics.potential_energy(robot, height, q - joint)
        for joint in np.eye(2) * step
    ]
    numeric = np.stack(gradient, axis=-1) / (2 * step)
    np.testing.assert_allclose(dynamics.gravity_force(robot, q), numeric, rtol=1e-5, atol=1e-6)


def test_shapes_are_batched():
    robot = load_robot("legv2")
    q = np.zeros((4, 5, 2))
    assert dynamics.mass_matrix(robot, q).shape == (4, 5, 3, 3)
    assert dynamics.bias_force(robot, q, q).shape == (4, 5, 3)
    assert dynamics.kinetic_energy(robot, q, np.zeros((4, 5)), q).shape == (4, 5)
    assert kinematics.jacobian(robot, q).shape == (4, 5, 2, 2)
