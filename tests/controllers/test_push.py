import numpy as np
import pytest

from hopping_leg.controllers.energy_shaping import equations
from hopping_leg.controllers.energy_shaping.virtual_leg import (
    retraction,
)
from hopping_leg.robot import GRAVITY, load_robot

ROBOT = load_robot("legv2-paper")


def test_feedforward_force_does_the_work_of_the_climb_and_is_bounded_for_an_extended_leg():
    command, start, end = np.array([0.3, 0.35]), np.array([0.15, 0.26]), np.full(2, 0.25)
    force, extended = equations.feedforward_force(ROBOT, command, start, end)
    climb = 0.3 - 0.15 - ROBOT.foot.radius
    assert force * (0.25 - 0.15) == pytest.approx(ROBOT.mass * GRAVITY * climb)
    assert 0 < extended < 200


@pytest.mark.parametrize("exponent", [0.5, 1.0, 2.0])
def test_gain_rests_at_the_desired_height_and_moves_towards_it(exponent):
    reached = np.array([0.27, 0.30, 0.33])
    gain = equations.updated_gain(np.ones(3), np.full(3, 0.3), reached, exponent)
    np.testing.assert_allclose(gain, (0.30 / reached) ** exponent)
    assert gain[1] == 1


@pytest.mark.parametrize("reached", [0.0, -1.0, 1.2])
def test_absurd_estimates_move_the_gain_a_bounded_step(reached):
    gain = equations.updated_gain(np.ones(1), np.array([0.3]), np.array([reached]), 2.0)
    assert equations.STEP[0] ** 2 <= gain[0] <= equations.STEP[1] ** 2


def test_retraction_starts_and_ends_at_rest_at_its_ends():
    start, end = np.array([[0.3, -0.8]]), np.array([[0.8, -1.5]])
    for elapsed, where in ((0.0, start), (0.1, end), (0.4, end)):
        q, qd = retraction(start, end, np.array([elapsed]), 0.1)
        np.testing.assert_allclose(q, where)
        np.testing.assert_allclose(qd, 0, atol=1e-12)
