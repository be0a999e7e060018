import numpy as np
import polars as pl
import pytest

from hopping_leg.evaluate.metrics import measure, skipped_in_run
from hopping_leg.evaluate.result import summarise
from hopping_leg.trace import COLUMNS, Trace

RATE = 200.0


def sine_trace(seconds=10.0, hops_per_second=2.0, apex=0.31, switch=None):
    """Base and foot swing together: in the air for the upper half of a sine."""
    time = np.arange(round(seconds * RATE)) / RATE
    phase = 2 * np.pi * hops_per_second * time
    columns = {name: np.zeros_like(time) for name in COLUMNS}
    columns |= {
        "time_s": time,
        "command_m": np.full_like(time, 0.30),
        "height_m": apex - 0.1 + 0.1 * np.sin(phase),
        "height_rate_m_s": 0.1 * 2 * np.pi * hops_per_second * np.cos(phase),
        "foot_clearance_m": 0.05 * np.sin(phase),
        "knee_clearance_m": np.full_like(time, 0.02),
        "base_clearance_m": np.full_like(time, 0.1),
    }
    if switch is not None:
        columns["command_m"][time >= switch] = 0.32
    return Trace(pl.DataFrame(columns))


def window_of(trace):
    (window,) = measure(trace)
    return window


def with_column(trace, name, values):
    return Trace(trace.table.with_columns(pl.Series(name, values)), trace.header)


def test_a_steady_run():
    window = window_of(sine_trace())
    assert window.command == 0.30
    assert len(window.apex) == 16
    assert window.apex - window.command == pytest.approx(0.01, abs=1e-4)
    assert window.settled == pytest.approx(8.0)
    assert window.flight / window.settled == pytest.approx(0.48, abs=0.02)
    assert window.skipped == window.bounces == 0
    row = summarise("c", 0.30, [window], 0)
    assert row.min_base_height_m == pytest.approx(0.11, abs=1e-3)
    assert row.max_sink_m == pytest.approx(0.05, abs=1e-3)


def test_the_start_and_every_switch_are_left_to_settle():
    first, second = measure(sine_trace(switch=5.0))
    assert (first.command, second.command) == (0.30, 0.32)
    assert first.settled == pytest.approx(3.0)
    assert second.settled == pytest.approx(4.0)
    assert (len(first.apex), len(second.apex)) == (6, 8)


def test_contacts_are_counted_as_events_even_while_the_run_settles():
    trace = sine_trace()
    knee, base = (trace.column(f"{part}_clearance_m") for part in ("knee", "base"))
    knee[10:20] = -0.001
    knee[500:503] = 0.0
    base[0:5] = -0.01
    touched = with_column(with_column(trace, "knee_clearance_m", knee), "base_clearance_m", base)
    window = window_of(touched)
    assert (window.contacts("base"), window.contacts("knee")) == (1, 2)


def test_a_hop_missed_right_after_a_switch_is_seen_in_the_whole_run():
    trace = sine_trace(switch=5.0)
    clearance = trace.column("foot_clearance_m")
    clearance[1000:1080] = np.minimum(clearance[1000:1080], 0.0)
    missed = with_column(trace, "foot_clearance_m", clearance)
    assert skipped_in_run(trace) == 0
    assert skipped_in_run(missed) == 1


def test_a_run_without_hops_stays_in_median_distance_and_interval():
    hopping, standing = sine_trace(), sine_trace()
    still = with_column(standing, "foot_clearance_m", np.zeros(len(standing.table)))
    (hops,), (none,) = measure(hopping), measure(still)
    row = summarise("c", 0.30, [hops, none, none], 0)
    assert (row.runs, row.missed_runs, row.hops) == (3, 2, len(hops.apex))
    assert row.median_error_m == pytest.approx(-0.09)
    assert row.mean_abs_error_m == pytest.approx((0.01 + 2 * 0.09) / 3, abs=1e-4)
    assert row.median_error_low_m == pytest.approx(-0.09)
    assert row.median_error_high_m == pytest.approx(0.01, abs=1e-4)
    assert row.std_m < 1e-3, "the spread is of the hops that there were"
