"""MuJoCo as an engine: the stepper's leg in a hop, and what it refuses."""

import numpy as np
import pytest

from hopping_leg.controllers.registry import load_controller
from hopping_leg.controllers.rollout import RolloutConfig, rollout
from hopping_leg.errors import UsageError
from hopping_leg.robot import load_robot
from hopping_leg.sim import NO_NOISE, make_simulator
from hopping_leg.sim.mujoco_simulator import MujocoSimulator
from tests.sim.legs import POSTURE, STEP, with_joints

CAD = load_robot("legv2")


def tight(spec):
    """Let MuJoCo's solver go on to rounding."""
    spec.option.tolerance, spec.option.iterations = 1e-15, 200


def hops(engine, robot, ticks=400):
    """Return heights of what energy shaping does at two commands in an engine.

    The legs fall a little first: whether a foot at zero distance touches is up to rounding.
    """
    config = RolloutConfig(
        robot=robot, engine=engine, disturbance=NO_NOISE, timestep=STEP, threads=1
    )
    commands = np.tile([0.28, 0.33], (ticks, 1))
    controller = load_controller("energy-shaping", robot)

    def drop(legs):
        legs.stand(slice(None), POSTURE, 0.01)

    return rollout(controller, config, commands, 0, on_legs=drop).data["height_m"]


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
        make_simulator(robot, 4, threads=1),
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


def test_a_reality_is_refused():
    with pytest.raises(UsageError, match="reality"):
        MujocoSimulator(load_robot("twin"), 1)
