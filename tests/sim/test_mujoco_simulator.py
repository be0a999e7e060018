import dataclasses

import numpy as np
import pytest

from hopping_leg.errors import UsageError
from hopping_leg.robot import SoftLimits, load_robot
from hopping_leg.sim import MujocoSimulator, NoiseAndDelay, Plant
from tests.sim.legs import POSTURE, without_friction

CAD = load_robot("legv2")


def test_a_standing_leg_rests_on_the_ground():
    legs = MujocoSimulator(CAD, 1, threads=1)
    legs.stand(slice(None), POSTURE)
    np.testing.assert_allclose(legs.foot_clearance(), 0.0, atol=1e-12)
    legs.stand(slice(None), POSTURE, clearance=0.05)
    np.testing.assert_allclose(legs.foot_clearance(), 0.05, atol=1e-12)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_motor_never_drives_beyond_its_no_load_speed(sign):
    legs = MujocoSimulator(without_friction(CAD), 1, threads=1)
    legs.place(slice(None), 50.0, np.zeros(2))
    limit, speed = CAD.of_joints("torque_limit"), CAD.of_joints("no_load_speed")
    fastest = 0.0
    for _ in range(100):
        applied = legs.step(np.array([[0.0, sign * 1e3]]))
        assert (np.abs(applied) <= limit).all()
        fastest = max(fastest, float(np.abs(legs.qd[0, 1])))
    # Torque is held for a control period, so the knee may gain one period's worth.
    assert speed[1] * 0.8 < fastest < speed[1] * 1.5


def with_gears(**changes):
    hip = dataclasses.replace(CAD.hip, friction=0.2, damping=0.0, **changes)
    return dataclasses.replace(CAD, hip=hip)


@pytest.mark.parametrize("detailed", [False, True])
def test_a_gear_under_load_takes_its_share_of_the_torque_and_may_hold(detailed):
    """1.2 N m against 0.2 + 0.3 x 1.2 N m of friction move the hip as 0.84 N m without load do."""
    moved = []
    for share, torque, ticks in ((0.3, 1.2, 4), (0, 0.84, 4), (0.9, 1, 1), (0, 1, 1)):
        robot = with_gears(load_friction=share)
        legs = MujocoSimulator(robot, 1, threads=1, detailed=detailed)
        legs.place(slice(None), 3.0, np.zeros(2))
        for _ in range(ticks):
            legs.step(np.array([[torque, 0.0]]))
        moved.append(float(legs.qd[0, 0]))
    assert moved[0] > 0.5
    assert abs(moved[2]) < 0.1 < 0.4 < moved[3]
    assert moved[0] == pytest.approx(moved[1], rel=1e-6)


def test_soft_limits_hold_a_pushed_joint_near_its_bounds():
    legs = MujocoSimulator(CAD, 2, threads=1)
    plant = Plant(legs, NoiseAndDelay(0.0, 0.0, 0.0), SoftLimits(), np.random.default_rng(0))
    legs.place(slice(None), 20.0, POSTURE)
    for _ in range(150):
        plant.sense(np.zeros(2))
        plant.drive(np.array([[1.0, 1.0], [-1.0, -1.0]]))
        outside = np.maximum(legs.q - CAD.of_joints("upper"), CAD.of_joints("lower") - legs.q)
        assert outside.max() < 0.6
    assert outside.max() > 0.0


@pytest.mark.parametrize("timestep", [3e-3, 0.0, -1e-3, float("nan")])
def test_a_physics_step_that_cannot_be_is_refused(timestep):
    with pytest.raises(UsageError, match="physics step"):
        MujocoSimulator(CAD, 1, timestep=timestep, threads=1)
