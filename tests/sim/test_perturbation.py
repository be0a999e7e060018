"""Legs take on other robots, pushes and raised ground as stated."""

import dataclasses

import numpy as np
import pytest

from hopping_leg.errors import UsageError
from hopping_leg.robot import DriveMismatch, Latency, SensorMismatch, load_robot
from hopping_leg.sim import MujocoSimulator
from hopping_leg.sim.perturbation import Perturbation, Perturber
from tests.sim.legs import POSTURE, with_reality, without_friction

LEG = load_robot("legv2")


def both(**numbers):
    return {"hip": DriveMismatch(**numbers), "knee": DriveMismatch(**numbers)}


DIFFERENT = (
    with_reality(latency=Latency(command=0.004, measurement=0.001)),
    with_reality(**both(torque_gain=0.8, torque_lag=0.003)),
    with_reality(voltage=0.5),
    with_reality(**both(sensor=SensorMismatch(position_step=0.01))),
    dataclasses.replace(LEG, rail=dataclasses.replace(LEG.rail, friction=3.0)),
)


def moved(legs, ticks=40, start=0):
    """Return states and readings of legs that are shaken, (ticks, n, 10)."""
    rng = np.random.default_rng(1)
    rng.uniform(size=(start, 2))
    rows = []
    for _ in range(ticks):
        legs.step(np.tile(rng.uniform(-6, 6, 2), (legs.count, 1)))
        rows.append(np.concatenate([legs.state, legs.measured_q, legs.measured_qd], axis=1))
    return np.array(rows)


def standing(robot, count=1, **options):
    legs = MujocoSimulator(robot, count, threads=1, **options)
    legs.stand(slice(None), POSTURE, 0.05)
    return legs


def test_legs_with_realities_of_their_own_move_as_each_does_alone():
    together = moved(standing(LEG, len(DIFFERENT), robots=DIFFERENT))
    for index, robot in enumerate(DIFFERENT):
        alone = moved(standing(robot, detailed=True))
        np.testing.assert_allclose(together[:, index], alone[:, 0], atol=1e-9)
    assert np.ptp(together[-1, :, 1]) > 1e-3


def test_backlash_of_different_width_but_not_beside_none():
    loose = [with_reality(**both(backlash=width)) for width in (0.01, 0.05)]
    together = moved(standing(LEG, 2, robots=loose))
    for index, robot in enumerate(loose):
        np.testing.assert_array_equal(together[:, index], moved(standing(robot))[:, 0])
    with pytest.raises(UsageError, match="backlash"):
        MujocoSimulator(LEG, 2, robots=[loose[0], LEG])
    with pytest.raises(UsageError, match="stiction"):
        MujocoSimulator(LEG, 2, robots=[LEG, with_reality(**both(stiction=1.5))])


@pytest.mark.parametrize("detailed", [False, True])
def test_becoming_the_same_changes_nothing_and_another_only_what_follows(detailed):
    plain = standing(LEG, 2, detailed=detailed)
    before = moved(plain, 20)
    changed = standing(LEG, 2, robots=[LEG, LEG], detailed=detailed)
    np.testing.assert_array_equal(moved(changed, 20), before)
    changed.set_robots([LEG, DIFFERENT[4]])
    after, otherwise = moved(changed, 20, start=20), moved(plain, 20, start=20)
    np.testing.assert_array_equal(after[:, 0], otherwise[:, 0])
    assert np.abs(after[-1, 1] - otherwise[-1, 1]).max() > 1e-6


def test_a_delay_that_begins_keeps_the_command_under_way():
    legs = standing(LEG, detailed=True)
    legs.step(np.full((1, 2), 2.0))
    legs.set_robots([with_reality(latency=Latency(command=0.005))])
    np.testing.assert_allclose(legs.step(np.full((1, 2), -3.0)), 2.0)
    np.testing.assert_allclose(legs.step(np.zeros((1, 2))), -3.0)
    with pytest.raises(UsageError, match="detailed"):
        standing(LEG).set_robots(DIFFERENT[:1])


def perturbed(legs, force=0.0, ground=0.0, ticks=40):
    count = legs.count
    plan = Perturbation(
        (legs.robot,) * count,
        np.zeros((ticks, count, 2)),
        np.full((ticks, count), force),
        np.full((ticks, count), ground),
    )
    return Perturber(plan, legs)


@pytest.mark.parametrize("detailed", [False, True])
def test_a_push_changes_the_base_speed_by_impulse_over_mass(detailed):
    frictionless = without_friction(LEG)
    pushed, free = (
        MujocoSimulator(frictionless, 1, threads=1, detailed=detailed) for _ in range(2)
    )
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


@pytest.mark.parametrize("detailed", [False, True])
@pytest.mark.parametrize("rise", [0.03, -0.03])
def test_ground_steps_shift_floor_and_clearance_once_the_foot_is_clear(detailed, rise):
    legs = MujocoSimulator(LEG, 2, threads=1, detailed=detailed)
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
