"""A supervised leg stands, hops as often as asked, is caught in the air and stands again."""

import numpy as np
import pytest

from hopping_leg.controllers import RolloutConfig, rollout
from hopping_leg.controllers.energy_shaping.virtual_leg import LegView
from hopping_leg.controllers.registry import load_controller
from hopping_leg.controllers.stand_hop_land import (
    STAND_SECONDS,
    LiftoffDetector,
    Mode,
    StandHopLand,
)
from hopping_leg.errors import UsageError
from hopping_leg.robot import GRAVITY, load_robot
from tests.controllers.measurements import hops_of
from tests.evaluate.conftest import Spring

ROBOT = load_robot("legv2-paper")


@pytest.fixture(scope="module")
def hopped():
    supervised = StandHopLand(load_controller("energy-shaping", ROBOT), ROBOT, 2)
    return rollout(supervised, RolloutConfig(ROBOT, threads=1), np.full((900, 4), 0.3), seed=11)


def test_it_hops_as_often_as_asked_and_ends_at_rest(hopped):
    for leg in range(4):
        hops = hops_of(hopped, leg)
        assert len(hops.apex) == 2
        assert hopped.data["counted_hops"][-1, leg] == 2
        assert hops.tick[0] > STAND_SECONDS * 200
    end = hopped.data["height_m"][-60:]
    assert np.ptp(end) < 0.002
    np.testing.assert_allclose(end, RolloutConfig(ROBOT).standing_length + 0.01, atol=0.015)
    assert hopped.data["base_clearance_m"].min() > 0


def test_modes_follow_each_other_and_the_catch_is_in_the_air(hopped):
    mode, clear = hopped.data["mode"], hopped.data["foot_clearance_m"]
    for leg in range(4):
        changes = np.flatnonzero(np.diff(mode[:, leg])) + 1
        assert mode[changes, leg].tolist() == [Mode.HOP, Mode.FLY, Mode.BRAKE, Mode.STAND]
        caught, met = changes[1], changes[2]
        assert clear[caught + 6, leg] > 0
        assert clear[met, leg] < 0.003
        assert clear[met - 10, leg] > 0


@pytest.mark.parametrize("hops", [1, 3])
def test_it_measures_nothing_but_joints(hops):
    """The same joint samples give the same torques, whatever the height was."""
    supervised = StandHopLand(Spring(ROBOT), ROBOT, hops)
    seen, act = [], supervised.act

    def spy(measurement):
        seen.append((measurement, act(measurement)))
        return seen[-1][1]

    supervised.act = spy
    rollout(supervised, RolloutConfig(ROBOT, threads=1), np.full((500, 2), 0.3), seed=1)
    supervised.reset(2)
    for measurement, torque in seen:
        np.testing.assert_array_equal(act(measurement), torque)
        assert np.isfinite(torque).all()


def test_what_makes_no_sense_is_refused():
    spring = Spring(ROBOT)
    for controller, hops in ((spring, 0), (spring, -1), (None, 3)):
        with pytest.raises(UsageError, match="make no sense"):
            StandHopLand(controller, ROBOT, hops)


@pytest.mark.slow
def test_hops_are_counted_under_noise_and_delay():
    supervised = StandHopLand(load_controller("energy-shaping", ROBOT), ROBOT, 1000)
    commands = np.tile([0.3, 0.35], (1600, 4))
    run = rollout(supervised, RolloutConfig(ROBOT, threads=1), commands, seed=2)
    made = [len(hops_of(run, leg).apex) for leg in range(8)]
    counted = run.data["counted_hops"][-1]
    assert min(made) > 10
    assert np.abs(counted - made).max() <= 2


def liftoffs(rates):
    """Return when a leg lifts off that presses with its weight and lengthens like this, ticks."""
    detector, found = LiftoffDetector(ROBOT, 0.005, 1), []
    force, nothing = np.array([ROBOT.mass * GRAVITY]), np.zeros(1)
    for tick, rate in enumerate(rates):
        still = np.zeros((1, 2))
        leg = LegView(still, still, nothing, np.array([rate]), nothing, nothing, nothing)
        if detector.update(leg, force)[0]:
            found.append(tick)
    return found


def push(top, rise, fall):
    """Return leg rates that rise to a top and fall to nothing in so many ticks, m/s."""
    return np.concatenate([np.linspace(0, top, rise), np.linspace(top, 0, fall), np.zeros(4)])


HOP, RISE, CREEP = push(1.0, 15, 6), push(0.55, 15, 40), push(0.3, 10, 5)


@pytest.mark.parametrize(
    ("rates", "expected"),
    [
        pytest.param(HOP, 1, id="a push that ends at once"),
        pytest.param(RISE, 0, id="slows down gently and stays on the ground"),
        pytest.param(np.concatenate([RISE, HOP]), 1, id="a rise before does not hide the push"),
        pytest.param(CREEP, 0, id="creeps up"),
        pytest.param(np.tile(push(1.0, 8, 5), 2), 1, id="no second lift-off within the flight"),
    ],
)
def test_lift_offs_are_counted(rates, expected):
    found = liftoffs(rates)
    assert len(found) == expected
    assert rates is not HOP or 15 < found[0] <= 21
