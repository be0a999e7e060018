"""Lift-off from the leg's rate and the force that it presses with."""

import numpy as np

from hopping_leg.controllers.energy_shaping.virtual_leg import LegView
from hopping_leg.controllers.stand_hop_land import LiftoffDetector
from hopping_leg.robot import load_robot
from hopping_leg.robot.model import GRAVITY

ROBOT = load_robot("legv2-paper")
PERIOD = 0.005


def liftoffs(rates):
    """Return when a leg lifts off that presses with its weight and lengthens like this, ticks."""
    detector, found = LiftoffDetector(ROBOT, PERIOD, 1), []
    force, nothing = np.array([ROBOT.mass * GRAVITY]), np.zeros(1)
    for tick, rate in enumerate(rates):
        leg = LegView(
            np.zeros((1, 2)), np.zeros((1, 2)), nothing, np.array([rate]), nothing, nothing, nothing
        )
        if detector.update(leg, force)[0]:
            found.append(tick)
    return found


def push(top, rise, fall):
    """Return leg rates that rise to a top and fall to nothing in so many ticks, m/s."""
    return np.concatenate([np.linspace(0, top, rise), np.linspace(top, 0, fall), np.zeros(4)])


def test_a_push_that_ends_at_once_is_a_lift_off():
    rates = push(1.0, 15, 6)
    (tick,) = liftoffs(rates)
    assert 15 < tick <= 21


def test_a_leg_that_rises_and_slows_down_gently_stays_on_the_ground():
    assert liftoffs(push(0.55, 15, 40)) == []


def test_a_rise_before_the_push_does_not_hide_it():
    rates = np.concatenate([push(0.55, 15, 40), push(1.0, 15, 6)])
    assert len(liftoffs(rates)) == 1


def test_a_leg_that_creeps_up_is_no_push():
    assert liftoffs(push(0.3, 10, 5)) == []


def test_what_follows_within_the_flight_is_no_second_lift_off():
    assert len(liftoffs(np.tile(push(1.0, 8, 5), 2))) == 1
