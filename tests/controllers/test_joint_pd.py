import numpy as np
import pytest

from hopping_leg.controllers.joint_pd import JointGains, JointPD
from hopping_leg.errors import UsageError
from hopping_leg.robot import load_robot
from hopping_leg.sim import NO_NOISE, LegSimulator, Plant
from tests.controllers.measurements import steady


def test_torque_is_the_law_and_the_end_is_held():
    position = np.array([[0.1, -0.2], [0.3, -0.4]])
    velocity = np.array([[1.0, 2.0], [3.0, 4.0]])
    pd = JointPD(position, velocity, JointGains((10.0, 20.0), (0.5, 0.25)))
    for _ in range(2):
        pd.reset(1)
        np.testing.assert_allclose(pd.act(steady([0, 0], [0, 0])), [[1.5, -3.5]])
        for _ in range(3):
            np.testing.assert_allclose(pd.act(steady([0.3, -0.4], [2.0, 0.0])), [[0.5, 1.0]])
            assert pd.internals()["knee_position_command_rad"][0] == -0.4


@pytest.mark.parametrize("name", ["legv2", "legv2-paper", "twin"])
def test_every_leg_follows_with_the_default_gains(name):
    time = np.arange(400) / 200
    target = np.stack([0.5 * np.sin(3 * time), -1.2 + 0.3 * np.cos(3 * time)], axis=1)
    legs = LegSimulator(load_robot(name), 1, threads=1, fixed_base=True)
    plant = Plant(legs, NO_NOISE, None, np.random.default_rng(0))
    legs.place(slice(None), 1.0, target[0])
    pd = JointPD(target)
    for tick in range(400):
        torque = pd.act(plant.sense(np.zeros(1)))
        plant.drive(torque)
        assert np.abs(legs.q[0] - target[tick]).max() < 0.25
        assert np.abs(torque).max() < 6.0


def test_negative_gains_are_refused():
    with pytest.raises(UsageError, match="damping"):
        JointGains(damping=(-1.0, 0.0))
