import numpy as np
import pytest

from hopping_leg.controllers import RolloutConfig, rollout
from hopping_leg.controllers.registry import load_controller
from hopping_leg.controllers.shooting import HopShape, Shooting
from hopping_leg.errors import UsageError
from hopping_leg.hop_detection import find_hops
from hopping_leg.robot import load_robot

SECONDS = 5.0


def hop(robot, commands, engine="stepper", seed=0):
    setup = RolloutConfig(robot, soft_limits=None, timestep=2.5e-4, threads=1, engine=engine)
    wanted = np.tile(commands, (round(SECONDS * setup.rate), 1))
    return rollout(Shooting(robot), setup, wanted, seed)


def apexes(run, leg):
    columns = (run.data[c][:, leg] for c in ("height_m", "height_rate_m_s", "foot_clearance_m"))
    hops = find_hops(*columns)
    return hops.apex[run.time[hops.tick] > 1.5]


@pytest.mark.parametrize("name", ["legv2", "legv2-paper"])
def test_every_hop_is_as_high_as_asked_under_torque_noise_on_any_ground(name):
    commands = np.array([0.25, 0.30, 0.35, 0.40])
    run = hop(load_robot(name), commands)
    for leg, command in enumerate(commands):
        errors = apexes(run, leg) - command
        assert len(errors) >= 5
        assert np.abs(np.median(errors)) < 0.002
        assert errors.std() < 0.003
    beyond = run.data["knee_position_rad"] < load_robot(name).knee.lower
    assert beyond.mean() < 0.01


def test_a_new_command_holds_for_the_next_push():
    robot = load_robot("legv2")
    setup = RolloutConfig(robot, timestep=2.5e-4, threads=1)
    commands = np.repeat([[0.25], [0.36], [0.28]], 400, axis=0)
    run = rollout(Shooting(robot), setup, commands, seed=0)
    found = find_hops(
        run.data["height_m"][:, 0], run.data["height_rate_m_s"][:, 0],
        run.data["foot_clearance_m"][:, 0],
    )  # fmt: skip
    asked = commands[found.tick, 0]
    late = (found.tick % 400 > 200) & (found.tick > 200)
    np.testing.assert_allclose(found.apex[late], asked[late], atol=0.005)


def test_lengths_of_a_hop_fit_the_leg():
    robot = load_robot("legv2")
    numbers = HopShape().hops(robot, np.linspace(0.22, 0.44, 12))
    assert (np.diff(numbers[:, 0]) >= 0).all()
    reach = robot.thigh.length + robot.shank.length
    assert (numbers[:, 2] > numbers[:, 3]).all()
    assert (numbers[:, 2:] < reach).all()


def test_it_is_for_simulated_legs_of_the_stepper_alone():
    with pytest.raises(UsageError, match="true state"):
        load_controller("shooting", load_robot("legv2"))
    with pytest.raises(UsageError, match="stepper"):
        hop(load_robot("legv2"), np.array([0.3]), engine="mujoco")
