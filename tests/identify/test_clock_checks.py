"""A clock that wraps goes on, one that is too coarse is named."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hopping_leg.errors import RecordingError
from hopping_leg.identify.recording import make_recording
from tests.identify.runs import METADATA, swinging


def load(time, rate=200.0):
    table = swinging(len(time), rate).with_columns(time_s=time)
    return make_recording(table, dataclasses.replace(METADATA, rate_hz=rate), "log.csv")


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
    recording = load(true % period)
    (warning,) = recording.warnings
    assert f"begins anew at {period:.10g} s before row" in warning
    np.testing.assert_allclose(recording.time - recording.time[0], true - true[0], atol=1e-9)


@settings(max_examples=15)
@given(tick=st.floats(0.31, 6.0), rate=st.sampled_from([100.0, 200.0, 500.0]))
def test_a_coarse_clock_is_refused_unless_it_counts_in_periods(tick, rate):
    if abs(1 / tick - round(1 / tick)) < 0.02:
        return
    time = np.floor(np.arange(600) / tick + 1e-9) * tick / rate
    with pytest.raises(RecordingError, match="coarse"):
        load(np.round(time, 7), rate)


def test_a_finer_clock_is_doubted_and_a_whole_period_or_jitter_is_not():
    time = np.arange(600) / 200
    (warning,) = load(np.floor(time / 9e-4) * 9e-4).warnings
    assert "counts in 0.9 ms" in warning
    rng = np.random.default_rng(0)
    assert load(np.round(time, 3)).warnings == ()
    assert load(time + rng.uniform(-1e-3, 1e-3, 600)).warnings == ()
