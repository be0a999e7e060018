import mujoco
import numpy as np
import pytest
from hypothesis import given, settings

from hopping_leg.robot import build_model, dynamics, kinematics, load_robot
from tests.robot.legs import SEEDS, posed, random_robot, random_state


@settings(max_examples=40)
@given(SEEDS)
def test_mass_matrix_forces_and_energies_agree_with_mujoco(seed):
    rng = np.random.default_rng(seed)
    robot = random_robot(rng)
    height, rate, q, qd = random_state(rng)
    model = build_model(robot)
    model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    data = posed(model, height, rate, q, qd)
    full = np.zeros((3, 3))
    mujoco.mj_fullM(model, data, full)
    np.testing.assert_allclose(dynamics.mass_matrix(robot, q)[0], full, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(
        dynamics.bias_force(robot, q, qd)[0], data.qfrc_bias, rtol=1e-7, atol=1e-9
    )
    potential, kinetic = data.energy
    assert dynamics.kinetic_energy(robot, q, rate, qd)[0] == pytest.approx(kinetic, rel=1e-9)
    assert dynamics.potential_energy(robot, height, q)[0] == pytest.approx(potential, rel=1e-9)
    still = posed(model, height, 0 * rate, q, 0 * qd)
    gravity = dynamics.gravity_force(robot, q)[0]
    np.testing.assert_allclose(gravity, still.qfrc_bias, rtol=1e-7, atol=1e-9)


def test_shapes_are_batched():
    robot = load_robot("legv2")
    q = np.zeros((4, 5, 2))
    assert dynamics.mass_matrix(robot, q).shape == (4, 5, 3, 3)
    assert dynamics.bias_force(robot, q, q).shape == (4, 5, 3)
    assert dynamics.kinetic_energy(robot, q, np.zeros((4, 5)), q).shape == (4, 5)
    assert kinematics.jacobian(robot, q).shape == (4, 5, 2, 2)
