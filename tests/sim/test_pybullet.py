import sys

import mujoco
import numpy as np
import pytest

from hopping_leg.errors import UsageError
from hopping_leg.robot import build_model, dynamics, kinematics, load_robot
from hopping_leg.robot.kinematics import joint_angles
from hopping_leg.sim import LegSimulator
from hopping_leg.sim.pybullet import PyBulletSimulator
from hopping_leg.sim.pybullet.ground_law import GroundLaw
from tests.robot.legs import random_state
from tests.sim.legs import POSTURE, without_friction

pybullet = pytest.importorskip("pybullet", reason="needs the extra 'bullet'")

PAPER = load_robot("legv2-paper")
CAD = load_robot("legv2")


@pytest.mark.parametrize("robot", [PAPER, CAD], ids=lambda r: r.name)
def test_torques_in_the_air_accelerate_as_the_closed_form_with_armature(robot):
    robot, step = without_friction(robot), 1e-5
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


@pytest.mark.parametrize(("share", "moves"), [(0.9, False), (1.2, True)])
def test_coulomb_friction_holds_a_joint_against_smaller_torques(share, moves):
    legs = PyBulletSimulator(PAPER, 1)
    legs.place(slice(None), 3.0, np.zeros(2))
    for _ in range(20):
        legs.step(np.array([[share * PAPER.hip.friction, 0.0]]))
    assert (abs(legs.q[0, 0]) > 1e-3) == moves


def sink_and_rest(legs):
    """Drop a leg whose joints are held from 0.1 m; return the deepest sink and the last, m."""
    legs.stand(slice(None), POSTURE, clearance=0.1)
    depths = []
    for _ in range(round(0.8 * legs.rate)):
        legs.step(60 * (POSTURE - legs.q) - 0.3 * legs.qd)
        depths.append(-legs.foot_clearance()[0])
    return max(depths), depths[-1]


@pytest.mark.slow
def test_a_drop_sinks_into_the_robots_ground_as_in_the_stepper():
    deepest, last = sink_and_rest(LegSimulator(PAPER, 1, rate=1000, threads=1))
    in_bullet = sink_and_rest(PyBulletSimulator(PAPER, 1, rate=1000))
    assert in_bullet == pytest.approx((deepest, last), abs=2e-3)
    assert deepest > 0.03


def test_pybullets_own_ground_is_rigid():
    legs = PyBulletSimulator(PAPER, 1, rate=1000, ground="rigid")
    assert sink_and_rest(legs)[0] < 1e-4


def test_legs_do_not_meet_each_other():
    together, alone = (
        PyBulletSimulator(PAPER, 3, ground="rigid"),
        PyBulletSimulator(PAPER, 1, ground="rigid"),
    )
    for legs in (together, alone):
        legs.stand(slice(None), joint_angles(PAPER, np.array([0.2, 0.0])))
        for _ in range(20):
            legs.step(np.tile([0.5, 1.0], (legs.count, 1)))
    np.testing.assert_array_equal(together.state, np.tile(alone.state, (3, 1)))


def test_worlds_are_freed_with_their_legs():
    def next_world():
        world = pybullet.connect(pybullet.DIRECT)
        pybullet.disconnect(physicsClientId=world)
        return world

    before = next_world()
    legs = PyBulletSimulator(PAPER, 3, ground="rigid")
    assert next_world() > before
    del legs
    assert next_world() == before


def test_without_pybullet_there_is_a_sentence(monkeypatch):
    monkeypatch.setitem(sys.modules, "pybullet", None)
    with pytest.raises(UsageError, match=r"hopping-leg\[bullet\]"):
        PyBulletSimulator(PAPER, 1)


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
