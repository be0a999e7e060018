import dataclasses

import numpy as np
import pytest

from hopping_leg.errors import RobotError, UsageError
from hopping_leg.hop_detection import COLUMNS, find_hops
from hopping_leg.io import replace_at
from hopping_leg.robot import load_robot
from hopping_leg.viewer.live_leg import LiveSettings, LiveSimulation, default_settings

ROBOT = "legv2-paper"


def quiet(*controllers, robot=ROBOT, height=0.3):
    live = LiveSimulation(controllers or ("energy-shaping",), robot, height)
    live.set_settings(dataclasses.replace(live.settings, noise=False))
    return live


def advance(seconds, *lives):
    for live in lives:
        live.advance(seconds)
    return lives


def heights(live, leg=0):
    return live.tracks[leg].field("height_m")


def last_apexes(live, leg=0, seconds=1.5):
    rows = [live.tracks[leg].field(name)[-round(seconds * 200) :] for name in COLUMNS]
    return find_hops(*rows).apex


def test_the_leg_hops_to_what_is_commanded_while_it_runs():
    live = quiet(height=0.28)
    live.advance(3.0)
    low = last_apexes(live)
    assert live.set_height(0.34) == 0.34
    live.advance(3.0)
    high = last_apexes(live)
    assert np.median(low) == pytest.approx(0.28, abs=0.015)
    assert np.median(high) == pytest.approx(0.34, abs=0.015)


def test_heights_are_brought_into_what_every_controller_can_be_asked_for():
    live = quiet("energy-shaping", height=0.45)
    assert live.height == 0.45
    live.begin(("fast", "energy-shaping"), ROBOT)
    low, high = live.valid
    assert live.height == pytest.approx(high, abs=1e-3)
    assert live.set_height(0.0) == pytest.approx(low, abs=1e-3)


@pytest.mark.parametrize("robot", [ROBOT, "twin"])
def test_changed_settings_keeps_the_state_of_the_leg(robot):
    live, other = advance(0.5, quiet(robot=robot), quiet(robot=robot))
    live.set_settings(dataclasses.replace(live.settings, payload=0.5, delay=0.004))
    for one in (live, other):
        one.tick()
    before, at = heights(live)[-2:]
    assert at == heights(other)[-1]
    assert abs(at - before) < 0.02
    late = live.settings.apply(live.robot).reality.latency.command
    assert late == pytest.approx(live.robot.reality.latency.command + 0.004)


def test_a_push_moves_the_base_and_ends():
    pushed, left = advance(0.6, quiet(), quiet())
    pushed.push(40.0)
    advance(0.08, pushed, left)
    assert heights(pushed)[-1] > heights(left)[-1] + 0.005
    assert not pushed._legs._push.any()


def test_a_second_leg_hops_beside_the_first_and_settings_change_the_motion():
    live = quiet("energy-shaping")
    live.begin(("energy-shaping", "energy-shaping"), ROBOT)
    live.advance(0.4)
    np.testing.assert_array_equal(heights(live, 0), heights(live, 1))
    changes = {"payload": 0.6}, {"time_constant": 0.02}, {"delay": 0.02}, {"noise": True}
    lives = [quiet() for _ in range(5)]
    for other, change in zip(lives[1:], changes, strict=True):
        other.set_settings(dataclasses.replace(other.settings, **change))
    first, *others = advance(1.0, *lives)
    assert all(np.abs(heights(first) - heights(other)).max() > 1e-3 for other in others)


@pytest.mark.parametrize(
    ("names", "robot", "error", "sentence"),
    [
        (("nobody",), ROBOT, UsageError, "no controller 'nobody'"),
        (("fast",), "nothing", RobotError, "nothing"),
        (("fast",), "doublependulum", RobotError, "cannot hop"),
        (("fast",) * 3, ROBOT, UsageError, "one, or two"),
    ],
)
def test_a_refused_wish_changes_nothing(names, robot, error, sentence):
    live = quiet("energy-shaping")
    tracks = live.tracks
    with pytest.raises(error, match=sentence):
        live.begin(names, robot)
    assert (live.names, live.robot.name) == (("energy-shaping",), ROBOT)
    assert live.tracks is tracks
    live.advance(0.05)


def test_settings_begin_as_the_robot_has_them_and_change_the_ground_of_reality_too():
    live = quiet("energy-shaping")
    live.set_settings(dataclasses.replace(live.settings, payload=0.5))
    live.begin(live.names, "legv2")
    assert live.settings == default_settings(load_robot("legv2"))
    robot = replace_at(load_robot("twin"), "reality.ground.time_constant", 0.08)
    assert default_settings(robot).time_constant == 0.08
    changed = LiveSettings(time_constant=0.03).apply(robot)
    assert changed.reality.ground.time_constant == changed.contact.time_constant == 0.03


def test_an_unstable_leg_stands_up_again_and_says_so_beside_one_that_hops_on():
    live, other = quiet(), quiet()
    for one in (live, other):
        one.begin(("energy-shaping",) * 2, ROBOT)
    advance(0.3, live, other)
    live._legs.state[1] = np.nan
    advance(0.3, live, other)
    (notice,) = live.notices
    assert "stands up again" in notice
    assert np.isfinite(heights(live, 1)).all()
    np.testing.assert_array_equal(heights(live, 0), heights(other, 0))
