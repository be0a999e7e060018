"""The mechanics that the stepper and MuJoCo, its reference, obey."""

from dataclasses import replace

import numpy as np
import pytest

from hopping_leg.errors import UsageError
from hopping_leg.robot import GRAVITY, Boom, load_robot
from hopping_leg.sim import LegSimulator
from hopping_leg.sim.mujoco_simulator import MujocoSimulator
from tests.sim.legs import POSTURE, with_joints

PAPER, CAD = load_robot("legv2-paper"), load_robot("legv2")
KINDS = {"stepper": LegSimulator, "mujoco": MujocoSimulator}


@pytest.mark.parametrize("engine", KINDS)
def test_drop_on_the_rail_follows_friction_and_damping(engine):
    """A straight leg falls as a point mass: m v' = -m g + Fc - b v, the closed form beside it."""
    legs = KINDS[engine](PAPER, 1, threads=1)
    legs.place(slice(None), 3.0, np.zeros(2))
    damping, force = PAPER.rail.damping, PAPER.mass * GRAVITY - PAPER.rail.friction
    for _ in range(60):
        legs.step(np.zeros((1, 2)))
    speed = force / damping * (1 - np.exp(-damping * 0.3 / PAPER.mass))
    np.testing.assert_allclose(legs.height_rate, -speed, rtol=2e-3)
    np.testing.assert_allclose(legs.q, 0.0, atol=1e-9)


def tight(spec):
    """Let MuJoCo's solver go on to rounding."""
    spec.option.tolerance, spec.option.iterations = 1e-15, 200


@pytest.mark.parametrize("engine", KINDS)
def test_what_became_unstable_stays_so_and_its_neighbour_goes_on(engine):
    alone, legs = (KINDS[engine](PAPER, count, threads=1) for count in (1, 2))
    alone.stand(slice(None), POSTURE)
    legs.stand(slice(None), POSTURE)
    legs.qd[0] = 1e12
    for _ in range(20):
        alone.step(np.zeros((1, 2)))
        legs.step(np.zeros((2, 2)))
    assert not np.isfinite(legs.state[0]).all()
    np.testing.assert_array_equal(legs.q[1], alone.q[0])


def test_motor_line_gain_load_friction_and_pushes_are_the_steppers():
    robot = with_joints(CAD, torque_gain=0.8, load_friction=0.2)
    reference = MujocoSimulator(robot, 4, threads=1, edit=tight)
    legs = LegSimulator(robot, 4, threads=1)
    rng = np.random.default_rng(0)
    push = rng.normal(0, 5, 4)
    for one in (reference, legs):
        one.stand(slice(None), POSTURE, 0.02)
        one.push(push)
    limited = 0
    for _ in range(30):
        torque = rng.uniform(-14, 14, (4, 2))
        given = reference.step(torque)
        np.testing.assert_allclose(legs.step(torque), given, atol=1e-9)
        np.testing.assert_allclose(legs.measured_torque, reference.measured_torque, atol=1e-9)
        np.testing.assert_allclose(legs.state, reference.state, atol=1e-9)
        legs.state[:] = reference.state
        limited += np.count_nonzero(np.abs(given - 0.8 * torque) > 1e-6)
    assert limited > 10


def test_mujoco_simulates_no_reality_and_no_boom_and_refuses_them():
    for robot in (load_robot("twin"), replace(load_robot("legv2"), boom=Boom(1.1))):
        with pytest.raises(UsageError, match="LegSimulator"):
            MujocoSimulator(robot, 1)
