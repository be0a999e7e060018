import itertools

import numpy as np
import pytest

from hopping_leg.deploy.motion_sequence import hopping_poses
from hopping_leg.deploy.weight_check import complaint, foot_force
from hopping_leg.robot import dynamics, load_robot
from hopping_leg.sim import LegSimulator

GAINS = np.array([20.0, 12.0]), np.array([0.3, 0.15])


@pytest.mark.parametrize("robot", ["legv2", "legv2-identified", "doublependulum"])
@pytest.mark.parametrize("push", [(0.0, 1.0), (0.3, 0.8), (-0.5, 1.7)])
def test_a_known_force_at_the_foot_is_found(robot, push):
    """Statics by virtual work: the foot's displacement is taken from differences."""
    leg, q = load_robot(robot), np.array([0.7, -1.5])
    weight, *joints = dynamics.gravity_force(leg, q)

    def foot(angles):
        ends = np.cumsum(angles)
        lengths = np.array([leg.thigh.length, leg.shank.length])
        return np.array([lengths @ np.sin(ends), -lengths @ np.cos(ends)])

    steps = 1e-6 * np.eye(2)
    jacobian = np.stack([(foot(q + s) - foot(q - s)) / 2e-6 for s in steps], axis=1)
    torque = np.array(joints) - jacobian.T @ (weight * np.array(push))
    np.testing.assert_allclose(foot_force(leg, q, torque), push, atol=1e-6)


def stands(name, wiring, start):
    """Let a leg whose drives believe multiples of its angles rise; return the complaint."""
    robot, wiring = load_robot(name), np.array(wiring)
    legs = LegSimulator(robot, 1, rate=200, timestep=2.5e-4, threads=1)
    legs.stand(slice(None), np.array(start) / wiring)
    goal, begin, forces = hopping_poses(robot).start, np.array(start), []
    for tick in range(400):
        q, qd = wiring * legs.measured_q[0], wiring * legs.measured_qd[0]
        target = begin + (goal - begin) * min(tick / 300, 1.0)
        torque = np.clip(GAINS[0] * (target - q) - GAINS[1] * qd, -10, 10)
        if tick >= 350:
            forces.append(foot_force(robot, q, torque))
        legs.step((wiring * torque)[None])
    return complaint(robot, *np.mean(forces, axis=0))


POSES = ((0.6, -1.2), (0.75, -1.6))


@pytest.mark.parametrize("robot", ["legv2", "legv2-identified", "legv2-paper"])
def test_a_leg_as_its_file_says_may_hop_and_one_that_is_wired_wrongly_may_not(robot):
    for start in POSES:
        assert stands(robot, (1, 1), start) == ""
    for start, wiring in itertools.product(POSES, ((-1, 1), (1, 0.5), (1, 2))):
        assert "check signs" in stands(robot, wiring, start)
