"""The mechanics that the stepper and MuJoCo, its reference, obey."""

import numpy as np
import pytest

from hopping_leg.controllers.registry import load_controller
from hopping_leg.controllers.rollout import RolloutConfig, rollout
from hopping_leg.errors import UsageError
from hopping_leg.robot import GRAVITY, load_robot
from hopping_leg.sim import NO_NOISE, LegSimulator
from hopping_leg.sim.mujoco_simulator import MujocoSimulator
from tests.sim.legs import POSTURE, STEP, energy, with_joints, without_friction

PAPER = load_robot("legv2-paper")
FRICTIONLESS = without_friction(load_robot("legv2"))


KINDS = {"stepper": LegSimulator, "mujoco": MujocoSimulator}


@pytest.fixture(params=KINDS)
def make(request):
    """Return a function that makes simulators."""
    return lambda robot, count, **options: KINDS[request.param](robot, count, threads=1, **options)


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
        np.testing.assert_allclose(legs.foot_clearance(), clearance, atol=1.1e-9)


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


CAD = load_robot("legv2")


def tight(spec):
    """Let MuJoCo's solver go on to rounding."""
    spec.option.tolerance, spec.option.iterations = 1e-15, 200


def hops(engine, robot, ticks=400):
    """Return heights of what energy shaping does at two commands in an engine.

    The legs fall a little first: whether a foot at zero distance touches is up to rounding.
    """
    config = RolloutConfig(robot=robot, disturbance=NO_NOISE, timestep=STEP, threads=1)
    legs = KINDS[engine](robot, 2, timestep=STEP, threads=1)
    commands = np.tile([0.28, 0.33], (ticks, 1))
    controller = load_controller("energy-shaping", robot)

    def drop(legs):
        legs.stand(slice(None), POSTURE, 0.01)

    controller.watch = drop
    return rollout(controller, config, commands, 0, legs=legs).data["height_m"]


@pytest.mark.parametrize("engine", ["stepper", "mujoco"])
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


def test_energy_shaping_hops_as_in_the_stepper():
    """Contacts amplify what MuJoCo's tolerance leaves of a difference."""
    one, other = (hops(engine, CAD) for engine in ("mujoco", "stepper"))
    assert np.abs(one - other)[:200].max() < 1e-4
    assert np.abs(one - other).max() < 1e-3
    apexes = (np.diff(np.sign(np.diff(other, axis=0)), axis=0) < 0).sum(axis=0)
    assert apexes.min() >= 3


def test_motor_line_gain_load_friction_and_pushes_are_the_steppers():
    robot = with_joints(CAD, torque_gain=0.8, load_friction=0.2)
    reference, legs = (
        MujocoSimulator(robot, 4, threads=1, edit=tight),
        LegSimulator(robot, 4, threads=1),
    )
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


def test_mujoco_simulates_no_reality_and_refuses_it():
    with pytest.raises(UsageError, match="reality"):
        MujocoSimulator(load_robot("twin"), 1)
