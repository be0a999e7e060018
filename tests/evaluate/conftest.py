import numpy as np
import pytest

from hopping_leg.controllers import RolloutConfig
from hopping_leg.evaluate import Entry, evaluate
from hopping_leg.robot import kinematics, load_robot


class Spring:
    """A virtual spring that pushes harder while the leg extends: hops, crudely."""

    name = "spring"

    def __init__(self, robot, command_range=None):
        self.robot, self.command_range = robot, command_range

    def reset(self, count):
        self.count = count

    def act(self, measurement):
        q, qd = measurement.q[:, 0], measurement.qd[:, 0]
        down, forward = kinematics.foot_position(self.robot, q).T
        rate, slip = kinematics.foot_velocity(self.robot, q, qd).T
        extending = (rate > 0) & (down < 0.24)
        push = 30.0 * (measurement.command[:, 0] / 0.3) ** 3
        force = 800.0 * (0.2 - down) - 4 * rate + push * extending
        sideways = -150 * forward - 5 * slip
        jacobian = kinematics.jacobian(self.robot, q)
        return np.einsum("nij,ni->nj", jacobian, np.stack([force, sideways], axis=1))

    def internals(self):
        return {}


@pytest.fixture(scope="session")
def robot():
    return load_robot("legv2-paper")


@pytest.fixture(scope="session")
def setup(robot):
    return RolloutConfig(robot, threads=1)


@pytest.fixture
def spring(robot):
    return Spring(robot)


@pytest.fixture(scope="session")
def judged(setup, robot):
    """One controller, everything but the ladder."""
    progress = []
    result = evaluate(
        [Entry("spring", Spring(robot))],
        setup,
        commands=[0.25, 0.35],
        repeats=2,
        kinds=("fixed", "sequence", "staircase"),
        on_progress=lambda label, share: progress.append((label, share)),
    )
    assert progress[-1] == ("spring", pytest.approx(1.0))
    return result
