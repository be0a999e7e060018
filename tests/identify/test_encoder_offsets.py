import numpy as np
import polars as pl
import pytest

from hopping_leg.identify.encoder_offsets import OffsetFinder
from hopping_leg.identify.parameters import LegHypothesis
from hopping_leg.identify.recording_format import PAIRS
from hopping_leg.identify.simulate import WindowSimulator
from hopping_leg.identify.validation import open_loop
from hopping_leg.identify.windows import cut, part
from hopping_leg.robot.robot_files import load_robot
from tests.identify.twin import STEP, changed, record, swing

PENDULUM = load_robot("doublependulum")
TRUE = LegHypothesis(PENDULUM)
OFF = np.array([0.04, -0.07])


SHOWN = [pl.col(name) + off for name, off in zip(PAIRS["position"], OFF, strict=True)]
"""Positions as encoders with offsets show them."""
RUN = record(PENDULUM, swing(3.0, rate=500.0), rate=500.0, onboard="torque")
RUN = changed(RUN, *SHOWN).with_metadata(zeroed=True)


def simulated(run, duration=None):
    return WindowSimulator([run], cut([run], duration), timestep=STEP).run([TRUE]).position[0]


def test_zeros_follow_from_the_balance_of_momentum():
    np.testing.assert_allclose(OffsetFinder(RUN).find(TRUE), OFF, atol=4e-3)


def test_a_wrong_robot_finds_about_the_same_zeros():
    heavy = TRUE.replace({"shank.com": 0.18, "knee.friction": 0.1, "thigh.inertia": 4e-3})
    np.testing.assert_allclose(OffsetFinder(RUN).find(heavy), OFF, atol=0.03)


def test_simulations_show_what_the_encoders_show():
    measured = RUN.array("position").reshape(12, 125, 2)
    got, wrong = simulated(RUN, 0.25), simulated(RUN.with_metadata(zeroed=False), 0.25)
    assert np.abs(got - measured).max() < 0.2 * np.abs(wrong - measured).max()


def test_what_tells_the_zeros_is_not_predicted():
    first = part(RUN, 0, 550)
    assert np.isnan(open_loop([first], TRUE, 0.2, STEP)).all()
    assert max(open_loop([RUN], TRUE, 0.2, STEP)) < 2e-3


@pytest.mark.parametrize("onboard", ["zoh", "continuous"])
def test_a_drive_that_tracks_positions_is_believed(onboard):
    run = record(PENDULUM, swing(1.0)).with_metadata(onboard=onboard, zeroed=True)
    np.testing.assert_array_equal(simulated(run), simulated(run.with_metadata(zeroed=False)))
