import mujoco
import numpy as np
import pytest

from hopping_leg.robot import build_model, kinematics, load_robot
from hopping_leg.sim.pybullet.ground_law import GroundLaw
from tests.sim.legs import without_friction


def random_contacts(robot, rng, count):
    """Return states with the foot up to 5 cm in the ground, and torques."""
    q = np.stack([rng.uniform(0.2, 1.2, count), rng.uniform(-2.1, -0.6, count)], axis=1)
    height = kinematics.stance_height(robot, q) - 10 ** rng.uniform(-4, -1.3, count)
    speed = np.concatenate([rng.normal(0, 1, (count, 1)), rng.normal(0, 3, (count, 2))], axis=1)
    return np.concatenate([height[:, None], q, speed], axis=1), rng.uniform(-9, 9, (count, 2))


def mujoco_force(robot, model, state, torque):
    """Return MuJoCo's upward and forward force on the foot, N, if nothing else touches."""
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = state[:3], state[3:]
    data.ctrl[:] = torque / robot.of_joints("belt_ratio")
    mujoco.mj_forward(model, data)
    force = np.zeros(6)
    mujoco.mj_contactForce(model, data, 0, force)
    return (force[0], -force[2]) if data.ncon == 1 else (np.nan, np.nan)


@pytest.mark.parametrize("name", ["legv2-paper", "legv2"])
def test_the_law_is_mujocos_contact(name):
    robot = without_friction(load_robot(name), damping=True)
    model, law = build_model(robot), GroundLaw(robot)
    states, torques = random_contacts(robot, np.random.default_rng(0), 200)
    cases = zip(states, torques, strict=True)
    expected = np.array([mujoco_force(robot, model, *case) for case in cases])
    lone = np.isfinite(expected[:, 0])
    forces = law.force(states, torques)
    np.testing.assert_allclose(forces[lone], expected[lone], rtol=2e-3, atol=0.05)
    assert np.count_nonzero(forces[lone, 0]) > 50
    states[:, 0] = 1.0
    np.testing.assert_array_equal(law.force(states, torques), 0.0)


def test_the_spring_is_the_law_at_rest():
    """A foot that neither moves nor accelerates feels the spring alone."""
    robot = without_friction(load_robot("legv2-paper"), damping=True)
    law, model = GroundLaw(robot), build_model(robot)
    data = mujoco.MjData(model)
    data.qpos[:] = [kinematics.stance_height(robot, np.zeros(2)), 0.0, 0.0]
    for _ in range(10000):
        mujoco.mj_step(model, data)
    sink = -kinematics.foot_clearance(robot, data.qpos[0], data.qpos[1:])
    assert sink > 1e-3
    stiffness, damping = law.spring
    assert stiffness * sink == pytest.approx(robot.mass * 9.81, rel=1e-3)
    assert damping / stiffness == pytest.approx(
        2 * robot.contact.time_constant * robot.contact.damping_ratio**2, rel=0.2
    )
