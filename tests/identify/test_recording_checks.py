"""What wraps goes on, spikes are left out, torques are held against the stated PD."""

import numpy as np
import polars as pl
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from hopping_leg.errors import RecordingError
from hopping_leg.identify.recording import make_recording
from hopping_leg.identify.recording_format import PAIRS
from tests.identify.runs import swinging
from tests.identify.test_recording import load
from tests.identify.twin import tracked


def clocked(time, rate=200.0):
    return load(swinging(len(time), rate).with_columns(time_s=time), rate_hz=rate)


def driven(table, **changes):
    return make_recording(table, tracked().with_metadata(**changes).metadata, "log.csv")


HIP = PAIRS["position"][0]


@settings(max_examples=10)
@given(speed=st.floats(2.0, 8.0), start=st.floats(-3.0, 3.0), side=st.sampled_from([-1, 1]))
def test_an_angle_that_wraps_goes_on(speed, start, side):
    t = swinging()["time_s"].to_numpy()
    true = start + side * speed * t
    table = swinging().with_columns(
        hip_position_rad=(true + np.pi) % (2 * np.pi) - np.pi,
        hip_velocity_rad_s=side * speed + 0 * t,
        hip_position_command_rad=true,
    )
    recording = load(table, robot="doublependulum")
    wraps = np.ptp(np.floor((true + np.pi) / (2 * np.pi))) > 0
    assert any("wraps" in warning for warning in recording.warnings) == wraps
    shown = recording.array("position")[:, 0]
    np.testing.assert_allclose(shown - shown[0], true - true[0], atol=1e-9)
    assert recording.has("velocity"), "it is the derivative"


@settings(max_examples=10)
@given(
    rows=st.sets(st.integers(3, 590), min_size=1, max_size=3),
    length=st.integers(1, 3),
    size=st.floats(0.3, 60.0),
    side=st.sampled_from([-1, 1]),
)
def test_spikes_are_left_out_and_nothing_else(rows, length, size, side):
    rows = sorted({row // 10 * 10 + 3 for row in rows})
    hit = np.concatenate([np.arange(row, row + length) for row in rows])
    values = swinging()[HIP].to_numpy().copy()
    values[hit] += side * size
    recording = load(swinging().with_columns(hip_position_rad=values))
    assert ["spikes" in w or "wraps" in w for w in recording.warnings] == [True]
    shown = recording.array("position")[:, 0]
    kept = np.setdiff1d(np.arange(600), hit)
    np.testing.assert_array_equal(shown[kept], swinging()[HIP].to_numpy()[kept])
    assert np.isfinite(recording.array("velocity")).all()


@settings(max_examples=15)
@given(
    bits=st.sampled_from([16, 24, 31, 32]),
    unit=st.sampled_from([1e-6, 1e-3]),
    start=st.floats(0.1, 2.9),
    jitter=st.floats(0, 3e-4),
)
def test_a_counter_that_wraps_goes_on(bits, unit, start, jitter):
    period = 2**bits * unit
    rng = np.random.default_rng(0)
    true = (1 + 3 // period) * period - start + np.arange(600) / 200 + jitter * rng.random(600)
    recording = clocked(true % period)
    assert ["began anew" in warning for warning in recording.warnings] == [True]
    np.testing.assert_allclose(recording.time - recording.time[0], true - true[0], atol=1e-9)


@settings(max_examples=15)
@given(tick=st.floats(0.31, 6.0), rate=st.sampled_from([100.0, 200.0, 500.0]))
def test_a_coarse_clock_is_refused_unless_it_counts_in_periods(tick, rate):
    if abs(1 / tick - round(1 / tick)) < 0.02:
        return
    time = np.floor(np.arange(600) / tick + 1e-9) * tick / rate
    with pytest.raises(RecordingError, match="coarse"):
        clocked(np.round(time, 7), rate)


@pytest.mark.parametrize("joint", [0, 1])
def test_a_joint_of_another_sign_is_refused_where_the_leg_stands(joint):
    flipped = [-pl.col(PAIRS[name][joint]) for name in ("position", "velocity")]
    table = swinging().with_columns(pl.col(HIP) + 0.7)
    assert load(table, rig="rail").warnings == load(table.with_columns(flipped)).warnings == ()
    with pytest.raises(RecordingError, match="change the sign of one of the joints"):
        load(table.with_columns(flipped), rig="rail")
    both = [-pl.col(name) for pair in ("position", "velocity") for name in PAIRS[pair]]
    assert "a mirrored 'legv2' stands" in load(table.with_columns(both), rig="rail").warnings[0]


def test_a_fine_clock_a_whole_period_or_jitter_is_believed():
    time, jitter = np.arange(600) / 200, np.random.default_rng(0).uniform(-1e-3, 1e-3, 600)
    assert clocked(np.round(time, 3)).warnings == clocked(time + jitter).warnings == ()


JOINTS = st.sampled_from([0, 1])


@settings(max_examples=15)
@given(joint=JOINTS, factor=st.floats(0.02, 20.0), side=st.sampled_from([-1, 1]))
def test_another_sign_or_unit_of_the_torque_is_refused(joint, factor, side):
    assume(side < 0 or not 0.7 < factor < 1.4)
    column = PAIRS["torque"][joint]
    wrong = tracked().trace.table.with_columns(pl.col(column) * (side * factor))
    says = "opposite sign|cannot be in N m" if side < 0 else "times what was|cannot be in N m"
    with pytest.raises(RecordingError, match=f"'{column}'.*({says})"):
        driven(wrong)


@pytest.mark.parametrize("late", [-1, 1, 3, 5])
def test_rows_that_are_late_or_early_are_named(late):
    table = tracked().trace.table.with_columns(pl.col(PAIRS["torque"]).shift(late))
    says = f"follows the stated PD {'early' if late < 0 else 'late'}, by .* {abs(late)} of its rows"
    if 0 < late < 4:
        assert [says.split(" by ")[0] in w for w in driven(table).warnings] == [True, True]
    else:
        with pytest.raises(RecordingError, match=says):
            driven(table)


def test_torques_of_other_gains_or_columns_are_refused():
    table = tracked().trace.table
    with pytest.raises(RecordingError, match="times what was asked for"):
        driven(table, stiffness=(20.0, 20.0), damping=(0.75, 0.75))
    hip, knee = PAIRS["torque"]
    with pytest.raises(RecordingError, match=r"what was asked for|does not follow|opposite"):
        driven(table.rename({hip: knee, knee: hip}))
    guesses = driven(table, stiffness=(20.0, 20.0), damping=(0.75, 0.75), gains_exact=False)
    assert guesses.warnings == ()


def test_the_torque_of_a_stated_pd_is_believed_and_rows_are_put_beside_their_commands():
    table = tracked().trace.table
    assert driven(table).warnings == ()
    commands = [c for name in ("position_command", "velocity_command") for c in PAIRS[name]]
    later = table.with_columns(pl.col(commands).shift(1)).slice(1)
    recording = driven(later, sample="after-command")
    assert recording.warnings == ()
    assert recording.metadata.sample == "before-command"
    np.testing.assert_array_equal(
        recording.array("position_command"), tracked().array("position_command")[1:-1]
    )
