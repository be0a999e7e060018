"""Legs take on other robots, pushes and raised ground as stated."""

import dataclasses

import numpy as np
import pytest

from hopping_leg.robot import load_robot
from hopping_leg.sim.perturbation import Perturbation, Perturber
from tests.sim.legs import POSTURE, make_legs, without_friction

LEG = load_robot("legv2")


def perturbed(legs, force=0.0, ground=0.0, ticks=40, **later):
    count = legs.count
    plan = Perturbation(
        (legs.robot,) * count,
        np.zeros((ticks, count, 2)),
        np.full((ticks, count), force),
        np.full((ticks, count), ground),
        **later,
    )
    return Perturber(plan, legs)


def test_a_push_changes_the_base_speed_by_impulse_over_mass():
    frictionless = without_friction(LEG)
    pushed, free = (make_legs(frictionless, 1) for _ in range(2))
    force, ticks = 20.0, 4
    perturber = perturbed(pushed, force)
    for legs in (pushed, free):
        legs.place(slice(None), 2.0, np.zeros(2))
    for tick in range(ticks):
        perturber.act(tick)
        pushed.step(np.zeros((1, 2)))
        free.step(np.zeros((1, 2)))
    impulse = force * ticks * pushed.period
    gained = pushed.height_rate - free.height_rate
    assert gained == pytest.approx(impulse / frictionless.mass, rel=1e-6)


@pytest.mark.parametrize("rise", [0.03, -0.03])
def test_ground_steps_shift_floor_and_clearance_once_the_foot_is_clear(rise):
    legs = make_legs(LEG, 2)
    legs.stand(slice(None), POSTURE, np.array([0.05, 0.0]))
    height, clearance = legs.height.copy(), legs.foot_clearance()
    perturber = perturbed(legs, ground=rise)
    perturber.act(0)
    np.testing.assert_allclose(perturber.ground, [rise, 0.0])
    np.testing.assert_allclose(legs.foot_clearance(), clearance - perturber.ground, atol=1e-12)
    perturber.act(1)
    np.testing.assert_allclose(legs.height, height - [rise, 0.0])
    for tick in range(2, 40):
        perturber.act(tick)
        legs.step(np.zeros((2, 2)))
    assert legs.height[0] < height[0]


def test_legs_become_others_at_the_stated_tick():
    heavy = dataclasses.replace(LEG, base=dataclasses.replace(LEG.base, mass=2 * LEG.base.mass))
    changed, plain = (make_legs(LEG, 2) for _ in range(2))
    perturber = perturbed(changed, later=(LEG, heavy), change=10)
    for legs in (changed, plain):
        legs.stand(slice(None), POSTURE)
    for tick in range(20):
        perturber.act(tick)
        for legs in (changed, plain):
            legs.step(np.full((2, 2), [0.0, 4.0]))
        same = (changed.state == plain.state).all(axis=1)
        assert same.tolist() == [True, tick < 10]
