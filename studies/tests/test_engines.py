"""Controllers hop in both engines, and PyBullet's leg moves as the closed form."""

import numpy as np
import pytest
from tests.robot.legs import random_state
from tests.sim.legs import without_friction

from hopping_leg.robot import dynamics, load_robot

pytest.importorskip("pybullet", reason="pybullet is not installed")
from studies.engines.pybullet import PyBulletSimulator
from studies.engines.run import Engines, hop


@pytest.mark.parametrize("name", ["legv2-paper", "legv2"])
def test_torques_in_the_air_accelerate_as_the_closed_form_with_armature(name):
    robot, step = without_friction(load_robot(name)), 1e-5
    legs = PyBulletSimulator(robot, 10, rate=1 / step, timestep=step)
    rng = np.random.default_rng(0)
    height, rate, q, qd = random_state(rng, 10)
    qd *= 0.3  # within what the motors can drive at
    q = q.clip(-2.5, 2.5)  # within the stops
    legs.place(slice(None), height, q)
    legs.height_rate[:], legs.qd[:] = rate, qd
    torque = rng.uniform(-3, 3, (10, 2))
    np.testing.assert_array_equal(legs.step(torque), torque)
    force = -dynamics.bias_force(robot, q, qd)
    force[:, 1:] += torque
    expected = np.linalg.solve(dynamics.mass_matrix(robot, q), force[..., None])[..., 0]
    gained = (legs.state[:, 3:] - np.column_stack([rate, qd])) / step
    np.testing.assert_allclose(gained, expected, rtol=1e-5, atol=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["MuJoCo", "PyBullet"])
def test_energy_shaping_hops_in_both(engine):
    """At a coarse step, for speed; the results file has the accuracy."""
    (row,) = hop(Engines(commands=(0.3,), seeds=1, timestep=1e-3), engine, "energy-shaping")
    assert row["hops"] > 15
    assert abs(row["median_error_m"]) < 0.03
