"""Torques and motion tell by themselves whose they are, and whose signs and zeros."""

import dataclasses

import numpy as np
import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hopping_leg.errors import RecordingError
from hopping_leg.identify.pipeline import identify
from hopping_leg.identify.plan import check_recordings
from hopping_leg.identify.recording_format import PAIRS
from hopping_leg.identify.torque_balance import check_balance
from hopping_leg.robot import load_robot
from tests.identify.twin import LEG, changed, record, swing, tracked

OF_A_JOINT = ("position", "velocity", "torque", "position_command", "velocity_command")
ANGLES = ("position", "position_command")


def test_the_legs_own_recording_is_believed_in_a_mirror_too():
    check_balance(tracked(), LEG)
    every = [column for name in OF_A_JOINT for column in PAIRS[name]]
    check_balance(changed(tracked(), -pl.col(every)), LEG)


@pytest.mark.parametrize("joint", [0, 1])
@pytest.mark.parametrize("names", [OF_A_JOINT, ("torque",)], ids=["joint", "torque"])
def test_a_joint_in_a_mirror_and_a_torque_against_its_motion_are_refused(names, joint):
    mirrored = changed(tracked(), -pl.col([PAIRS[name][joint] for name in names]))
    with pytest.raises(RecordingError, match=r"against its torque|sign"):
        check_balance(mirrored, LEG)


@settings(max_examples=8)
@given(joint=st.sampled_from([0, 1]), zero=st.floats(0.5, 2 * np.pi - 0.5))
def test_a_zero_elsewhere_is_refused(joint, zero):
    columns = [PAIRS[name][joint] for name in ANGLES]
    with pytest.raises(RecordingError, match=r"zero|sign"):
        check_balance(changed(tracked(), pl.col(columns) + zero), LEG)


def test_another_designs_links_are_refused():
    """Links of 0.2 and 0.3 m, recorded, and a file that says 0.3 and 0.2 m."""
    robot = load_robot("doublependulum")
    thigh, shank = robot.thigh, robot.shank
    longer = dataclasses.replace(shank, length=0.3, com=0.26, extent=0.35)
    other = dataclasses.replace(robot, thigh=dataclasses.replace(thigh, length=0.2, com=0.18))
    other = dataclasses.replace(other, shank=longer)
    t = np.arange(1500) / 250
    targets = np.stack([np.sin(2 * t) + 0.6 * np.sin(5 * t), 1.2 * np.sin(3 * t + 1)], axis=1)
    run = record(other, targets, rate=250.0, onboard="torque")
    run = run.with_metadata(robot="doublependulum")
    check_balance(run, other)
    with pytest.raises(RecordingError, match=r"thigh of 0\.\d+ .*'doublependulum' is 0\.3 m"):
        identify([run], robot)


@pytest.mark.parametrize("joint", ["hip", "knee"])
def test_one_joint_alone_is_refused_before_any_fit(joint):
    lacking = [PAIRS[name][joint == "knee"] for name in ("position", "velocity")]
    run = changed(tracked(), pl.lit(None, pl.Float64).alias(lacking[0]))
    with pytest.raises(RecordingError, match=f"no positions of the {joint}.*both joints"):
        check_recordings([run], LEG)


def test_a_leg_that_hardly_moves_says_nothing():
    still = record(LEG, 0.02 * swing(3.0) + [0.4, -1.0])
    check_balance(still, LEG)
