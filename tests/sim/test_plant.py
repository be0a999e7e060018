import numpy as np
import pytest

from hopping_leg.robot import SoftLimits, load_robot
from hopping_leg.sim import LegSimulator, NoiseAndDelay, Plant, SoftLimiter

ROBOT = load_robot("legv2")
OUTSIDE = np.array([1.5, -2.5])
COUNT = 64


def plant(soft_limits, disturbance, robot=ROBOT):
    """Return legs in the air, hip and knee beyond their soft limits and turning."""
    legs = LegSimulator(robot, COUNT, threads=1)
    made = Plant(legs, disturbance, soft_limits, np.random.default_rng(0))
    legs.place(slice(None), 5.0, OUTSIDE)
    made.channel.restart(slice(None), legs.q, legs.qd, np.zeros(COUNT))
    legs.qd[:] = np.random.default_rng(1).normal(0, 5, (COUNT, 2))
    return made


@pytest.mark.parametrize("replace", [False, True])
def test_soft_limits_act_on_the_sample_that_the_controllers_saw(replace):
    soft = SoftLimits(replace=replace)
    made, limiter = plant(soft, NoiseAndDelay()), SoftLimiter(ROBOT, soft)
    for _ in range(20):
        seen = made.sense(np.zeros(COUNT))
        torque = np.full((COUNT, 2), 0.5)
        made.drive(torque)
        expected = limiter.added(torque, np.concatenate([seen.q, seen.qd], axis=2))
        np.testing.assert_array_equal(made.soft_limit_torque, expected)
    assert (seen.age[:, 0] > 0).any()
    assert (made.soft_limit_torque != 0).any()


def test_what_soft_limits_add_is_noisy_and_limited_with_the_rest():
    noise = NoiseAndDelay(joint_noise=0.0, torque_noise=0.15, delay_probability=0.0)
    torque = np.full((COUNT, 2), -9.0)
    made = plant(SoftLimits(stiffness=100.0), noise)
    made.sense(np.zeros(COUNT))
    given = made.drive(torque)
    by_hand = plant(None, noise)
    by_hand.sense(np.zeros(COUNT))
    np.testing.assert_array_equal(by_hand.drive(torque + made.soft_limit_torque), given)
    assert (np.abs(made.soft_limit_torque) > 1).all()
    assert (np.abs(given) <= ROBOT.of_joints("torque_limit")).all()
