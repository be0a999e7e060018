"""MPC in the true state: hops are as high as asked, calm, and of one shape on any leg."""

import numpy as np
import pytest

from hopping_leg.controllers import RolloutConfig, rollout
from hopping_leg.controllers.mpc import TrueStateMpc
from hopping_leg.io import replace_at
from hopping_leg.robot import load_robot
from hopping_leg.sim import LegSimulator, leg_simulator
from hopping_leg.sim.any_leg import draw_leg
from hopping_leg.sim.randomization import IDENTIFIABLE_RANGES, draw_twin, sample
from tests.controllers.measurements import hops_of

HEIGHTS = np.linspace(0.22, 0.40, 10)
ROBOT = load_robot("legv2-identified")
SETTLED = 1.5
STEP = 2.5e-4  # Physics step of the legs, a fourth of the planned one, s
RUBBING = replace_at(replace_at(ROBOT, "hip.friction", 1.5), "knee.friction", 1.5)


def hop(robot, commands, legs=None):
    setup = RolloutConfig(robot, timestep=STEP, threads=1)
    wanted = np.tile(commands, (round(5 * setup.rate), 1))
    return rollout(TrueStateMpc(robot), setup, wanted, 0, legs=legs)


def check_apexes(run, commands, most=0.002):
    for leg, command in enumerate(commands):
        hops = hops_of(run, leg)
        errors = hops.apex[run.time[hops.tick] > SETTLED] - command
        assert len(errors) >= 5
        assert np.abs(np.median(errors)) < most
        assert errors.std() < 0.003


@pytest.fixture(scope="module", params=["legv2", "legv2-paper", "legv2-identified"])
def hopped(request):
    robot = load_robot(request.param)
    return robot, hop(robot, HEIGHTS)


def test_every_hop_is_as_high_as_asked_under_noise(hopped):
    check_apexes(hopped[1], HEIGHTS)


def test_hops_are_calm_and_the_foot_alone_touches_the_ground(hopped):
    robot, run = hopped
    data = {name: values[run.time > SETTLED] for name, values in run.data.items()}
    hip = np.sqrt(data["hip_mean_square_torque"].mean(axis=0))
    assert (hip[HEIGHTS < 0.385] <= 2).all()
    for part in ("knee", "base"):
        assert data[f"{part}_clearance_m"].min() > 0
    for joint in ("hip", "knee"):
        limits, angle = getattr(robot, joint), data[f"{joint}_position_rad"]
        assert np.mean((limits.lower <= angle) & (angle <= limits.upper)) >= 0.99


def test_legs_that_differ_hop_as_high_each_on_any_number_of_threads(monkeypatch):
    monkeypatch.setattr(leg_simulator, "_STEPS_PER_THREAD", 1)
    legv2 = load_robot("legv2")
    robots = sample(legv2, IDENTIFIABLE_RANGES, 6, np.random.default_rng(0))
    commands = np.tile([0.25, 0.32], 3)
    one, other = (
        hop(legv2, commands, legs=LegSimulator(legv2, 6, timestep=STEP, threads=n, robots=robots))
        for n in (1, 3)
    )
    check_apexes(one, commands)
    assert np.ptp(one.data["push_force_n"][-200:, ::2].max(axis=0)) > 1
    np.testing.assert_array_equal(one.data["height_m"], other.data["height_m"])


_DRAWN = [drawn.robot for drawn in (draw_twin(0), draw_twin(3), draw_leg(2))]


@pytest.mark.parametrize("robot", [*_DRAWN, RUBBING])
def test_legs_that_differ_or_rub_and_twins_with_every_effect_hop_as_high(robot):
    heights = np.array([0.83, 1.07, 1.31]) * robot.straight_height
    check_apexes(hop(robot, heights), heights)


@pytest.mark.parametrize("latency", [0.0035, 0.012])
def test_commands_under_way_are_planned_with(latency):
    """But their noise is not."""
    robot = replace_at(ROBOT, "reality.latency.command", latency)
    check_apexes(hop(robot, HEIGHTS[::3]), HEIGHTS[::3], most=0.003)
