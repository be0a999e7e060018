"""Angles that wrap go on, spikes are left out, and nothing else is."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hopping_leg.errors import RecordingError
from hopping_leg.identify.recording_format import PAIRS
from hopping_leg.robot import load_robot
from tests.identify.runs import swinging
from tests.identify.test_recording import load, set_rows

HIP, KNEE = PAIRS["position"]
PENDULUM = {"robot": "doublependulum"}


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
    recording = load(table, **PENDULUM)
    assert any("wraps" in warning for warning in recording.warnings) == (
        np.ptp(np.floor((true + np.pi) / (2 * np.pi))) > 0
    )
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
    (warning,) = recording.warnings
    assert "spikes" in warning or "wraps" in warning
    shown = recording.array("position")[:, 0]
    kept = np.setdiff1d(np.arange(600), hit)
    np.testing.assert_array_equal(shown[kept], swinging()[HIP].to_numpy()[kept])
    assert np.isfinite(recording.array("velocity")).all()


@pytest.mark.parametrize("jump", [0.9, 2 * np.pi / 6, 2.5])
def test_a_jump_that_stays_is_refused(jump):
    moved = set_rows(swinging(), HIP, slice(300, None), swinging()[HIP].to_numpy()[300:] + jump)
    with pytest.raises(RecordingError, match=r"jumps by .* rad before row 300"):
        load(moved)


def test_angles_beyond_the_stops_are_refused():
    low = load_robot("legv2").knee.stop_lower
    with pytest.raises(RecordingError, match=f"'{KNEE}' is -.*ends at {low:g}.*another robot"):
        load(swinging().with_columns(knee_position_rad=swinging()[KNEE] - 1.5))
