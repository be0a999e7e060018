"""The mechanics that every engine obeys."""

import numpy as np
import pytest

from hopping_leg.robot import GRAVITY, load_robot
from hopping_leg.sim import make_simulator
from tests.sim.legs import POSTURE, energy, without_friction

PAPER = load_robot("legv2-paper")
FRICTIONLESS = without_friction(load_robot("legv2"))


@pytest.fixture(params=["stepper", "mujoco", "pybullet"])
def make(request):
    """Return a function that makes simulators."""
    if request.param == "pybullet":
        pytest.importorskip("pybullet", reason="needs the extra 'bullet'")
    return lambda robot, count, **options: make_simulator(
        robot, count, engine=request.param, threads=1, **options
    )


def test_energy_is_conserved_without_friction(make):
    legs = make(FRICTIONLESS, 4)
    rng = np.random.default_rng(0)
    legs.place(slice(None), 3.0, rng.uniform(-1, 1, (4, 2)))  # far from the stops
    legs.qd[:] = rng.normal(0, 3, (4, 2))
    before, posture = energy(legs), legs.q.copy()
    for _ in range(60):
        legs.step(np.zeros((4, 2)))
    assert legs.height.min() > 1.0
    assert np.abs(legs.q - posture).max() > 0.5
    np.testing.assert_allclose(energy(legs), before, atol=0.03)


def test_free_fall_follows_the_parabola(make):
    legs = make(FRICTIONLESS, 1)
    legs.place(slice(None), 3.0, np.array([0.4, -1.0]))
    for tick in range(1, 61):
        legs.step(np.zeros((1, 2)))
        time = tick * legs.period
        # Semi-implicit Euler falls by g t dt / 2 more than the continuous leg.
        fall = GRAVITY * time * (time + legs.timestep) / 2
        np.testing.assert_allclose(legs.height, 3.0 - fall, atol=1e-9)
        np.testing.assert_allclose(legs.height_rate, -GRAVITY * time, atol=1e-9)


def test_drop_on_the_rail_follows_friction_and_damping(make):
    """A straight leg falls as a point mass: m v' = -m g + Fc - b v, the closed form beside it."""
    legs = make(PAPER, 1)
    legs.place(slice(None), 3.0, np.zeros(2))
    damping, force = PAPER.rail.damping, PAPER.mass * GRAVITY - PAPER.rail.friction
    for _ in range(60):
        legs.step(np.zeros((1, 2)))
    speed = force / damping * (1 - np.exp(-damping * 0.3 / PAPER.mass))
    np.testing.assert_allclose(legs.height_rate, -speed, rtol=2e-3)
    np.testing.assert_allclose(legs.q, 0.0, atol=1e-9)


def test_a_motor_hardly_drives_beyond_its_no_load_speed(make):
    legs = make(FRICTIONLESS, 1)
    legs.place(slice(None), 50.0, np.array([0.0, -2.0]))
    limit, speed = (FRICTIONLESS.of_joints(name) for name in ("torque_limit", "no_load_speed"))
    fastest = 0.0
    for _ in range(60):
        assert (np.abs(legs.step(np.array([[0.0, 1e3]]))) <= limit).all()
        if legs.q[0, 1] > 2.5:
            break
        fastest = max(fastest, float(legs.qd[0, 1]))
    assert 0.7 < fastest / speed[1] < 1.05


def test_a_standing_leg_rests_on_the_ground(make):
    legs = make(PAPER, 1)
    for clearance in (0.0, 0.05):
        legs.stand(slice(None), POSTURE, clearance)
        np.testing.assert_allclose(legs.foot_clearance(), clearance, atol=1e-12)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_stops_hold_the_joints(make, sign):
    legs, reached = make(PAPER, 1), 0.0
    legs.place(slice(None), 50.0, np.zeros(2))
    for _ in range(100):
        legs.step(sign * np.array([[1.0, 3.0]]) - 0.1 * legs.qd)
        beyond = np.maximum(PAPER.of_joints("stop_lower") - legs.q, 0)
        beyond += np.maximum(legs.q - PAPER.of_joints("stop_upper"), 0)
        assert beyond.max() < 0.06
        reached = max(reached, float(np.abs(legs.q[0, 1])))
    assert reached > 2.69
