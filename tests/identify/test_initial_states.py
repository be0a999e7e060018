import numpy as np
import polars as pl
import pytest

from hopping_leg.identify.initial_states import OffsetFinder, base_rate, full_states, start_states
from hopping_leg.identify.parameters import LegHypothesis
from hopping_leg.identify.recording_format import PAIRS
from hopping_leg.identify.simulate import WindowSimulator, cut
from hopping_leg.identify.validation import open_loop
from hopping_leg.robot import kinematics, load_robot
from tests.identify.twin import LEG, STEP, changed, noisy, record, swing

RUN = record(LEG, swing(3.0))
FAST = record(LEG, np.repeat(swing(2.0), 3, axis=0), rate=500.0)


@pytest.mark.parametrize("run", [RUN, FAST], ids=["200 Hz", "500 Hz"])
@pytest.mark.parametrize("states", [full_states, start_states])
def test_clean_sensors_are_believed(states, run):
    np.testing.assert_array_equal(states(run), [run.array("position"), run.array("velocity")])


def test_smoothing_comes_nearer_to_the_truth():
    position, velocity = start_states(noisy(FAST, position_rad=1e-4, velocity_rad_s=0.1))
    assert np.std(velocity - FAST.array("velocity"), axis=0).max() < 0.05
    assert np.abs(position - FAST.array("position")).max() < 1e-3


def test_no_difference_is_taken_across_a_touchdown():
    run = record(LEG, swing(0.5, "rail"), "rail")
    time, standing = run.time, kinematics.stance_height(LEG, run.array("position")) - 1e-3
    height = np.where(time < 0.2, 0.5 - 4.905 * time**2, standing)
    rate = base_rate(changed(run, height_m=height), LEG)
    np.testing.assert_allclose(rate[time < 0.2][2:], -9.81 * time[time < 0.2][2:], atol=1e-9)
    legs = kinematics.foot_velocity(LEG, run.array("position"), run.array("velocity"))[:, 0]
    np.testing.assert_allclose(rate[time >= 0.2], legs[time >= 0.2], atol=1e-9)


PENDULUM = load_robot("doublependulum")
TRUE = LegHypothesis(PENDULUM)
OFF = np.array([0.04, -0.07])
SHOWN = [pl.col(name) + off for name, off in zip(PAIRS["position"], OFF, strict=True)]
"""Positions as encoders with offsets show them."""
ZEROED = record(PENDULUM, swing(3.0, rate=500.0), rate=500.0, onboard="torque")
ZEROED = changed(ZEROED, *SHOWN).with_metadata(zeroed=True)


def simulated(run, duration=None):
    return WindowSimulator([run], cut([run], duration), timestep=STEP).run([TRUE]).position[0]


def test_zeros_follow_from_the_balance_of_momentum_nearly_whatever_the_robot():
    np.testing.assert_allclose(OffsetFinder(ZEROED).find(TRUE), OFF, atol=4e-3)
    heavy = TRUE.replace({"shank.com": 0.18, "knee.friction": 0.1, "thigh.inertia": 4e-3})
    np.testing.assert_allclose(OffsetFinder(ZEROED).find(heavy), OFF, atol=0.03)


def test_simulations_show_what_the_encoders_show():
    measured = ZEROED.array("position").reshape(12, 125, 2)
    got, wrong = simulated(ZEROED, 0.25), simulated(ZEROED.with_metadata(zeroed=False), 0.25)
    assert np.abs(got - measured).max() < 0.2 * np.abs(wrong - measured).max()


def test_what_tells_the_zeros_is_not_predicted():
    assert np.isnan(open_loop([ZEROED.part(0, 550)], TRUE, 0.2)).all()
    assert max(open_loop([ZEROED], TRUE, 0.2)) < 2e-3


@pytest.mark.parametrize(
    ("name", "step"),
    [("drive.delay", 2e-5), ("hip.friction", 1e-3), ("shank.com", 2e-4), ("knee.armature", 2e-5)],
)
def test_zeros_are_smooth_in_every_parameter(name, step):
    finder = OffsetFinder(ZEROED)
    values = TRUE.get(name) + step * np.arange(60)
    steps = np.diff([finder.find(TRUE.replace({name: value})) for value in values], axis=0)
    assert (np.abs(steps) > 0).all()
    assert (np.abs(steps).max(axis=0) < 3 * np.abs(steps).mean(axis=0)).all()
