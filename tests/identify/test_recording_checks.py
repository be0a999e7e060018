"""Each fault that logs have is named with file, column and row, and nothing else is."""

import dataclasses

import numpy as np
import polars as pl
import pytest

from hopping_leg.errors import RecordingError
from hopping_leg.identify.recording import make_recording
from tests.identify.runs import METADATA, swinging


def set_rows(table, column, rows, value):
    values = table[column].to_numpy().copy()
    values[rows] = value
    return table.with_columns(pl.Series(column, values))


def scaled(table, columns, factor):
    return table.with_columns(pl.col(columns) * factor)


def load(table, **metadata):
    return make_recording(table, dataclasses.replace(METADATA, **metadata), "log.csv")


def one_warning(recording):
    (warning,) = recording.warnings
    assert warning.startswith("log.csv: ")
    assert "\n" not in warning
    return warning


@pytest.mark.parametrize("value", [5e-324, -1e-310, 1e-40, np.inf, -np.inf, 1e300])
def test_uninitialised_memory_is_left_out(value):
    recording = load(set_rows(swinging(), "hip_torque_nm", [7, 30], value))
    warning = one_warning(recording)
    assert "'hip_torque_nm', row 7" in warning
    assert "2 such values" in warning
    assert np.isnan(recording.array("torque")[[7, 30], 0]).all()
    assert np.isfinite(recording.array("torque")[8:30]).all()


@pytest.mark.parametrize(
    ("rows", "value", "sentence"),
    [(slice(0, 500), 1e-310, "the column is left out"), (slice(None), 0.0, "is zero in all rows")],
)
def test_columns_of_garbage_or_zeros_are_left_out(rows, value, sentence):
    recording = load(set_rows(swinging(), "knee_torque_nm", rows, value))
    assert sentence in one_warning(recording)
    assert np.isnan(recording.array("torque")[:, 1]).all()


def test_a_command_of_zeros_is_kept():
    recording = load(set_rows(swinging(), "hip_command_nm", slice(None), 0.0))
    assert "'hip_command_nm' is zero in all rows" in one_warning(recording)
    assert (recording.array("torque_command")[:, 0] == 0).all()
    assert load(recording.trace.table, onboard="zoh").warnings == ()


def test_first_rows_of_sleeping_sensors_are_left_out():
    table = swinging()
    for column in ("hip_position_rad", "knee_position_rad"):
        table = set_rows(table, column, slice(0, 4), 0.0)
    recording = load(table)
    assert "rows 0 to 3 are start-up rows" in one_warning(recording)
    assert len(recording) == 596


def test_first_commands_that_were_not_applied_are_left_out():
    table = set_rows(swinging(), "hip_command_nm", 1, 15.0)
    recording = load(table)
    assert "rows 0 to 3 are start-up rows" in one_warning(recording)
    assert "hip_command_nm" in one_warning(recording)
    applied = set_rows(table, "hip_torque_nm", 2, 14.0)
    assert load(applied).warnings == ()


def test_stated_startup_rows_are_left_out_once():
    recording = load(swinging(), startup_rows=3)
    assert "rows 0 to 2 are start-up rows" in one_warning(recording)
    assert recording.time[0] == pytest.approx(0.015)


def test_jitter_and_sparse_values_are_normal():
    rng = np.random.default_rng(0)
    time = swinging()["time_s"].to_numpy() + rng.uniform(-5e-4, 5e-4, 600)
    table = swinging().with_columns(time_s=pl.Series(time))
    for column in table.columns[1:7]:
        kept = pl.Series(rng.random(600) < 0.5)
        table = table.with_columns(pl.when(kept).then(pl.col(column)).alias(column))
    assert load(table).warnings == ()


@pytest.mark.parametrize(
    ("table", "sentence"),
    [
        (swinging().drop("time_s"), "no column 'time_s'"),
        (swinging()[:0], "no rows"),
        (swinging()[:15], "too short: 15 rows.*hip_position_rad"),
        (swinging().drop("hip_position_rad", "knee_position_rad"), "too short"),
        (set_rows(swinging(), "time_s", 50, np.nan), "'time_s' has no time in row 50"),
        (set_rows(swinging(), "time_s", 50, 0.1), "'time_s' does not increase in row 50"),
        (set_rows(swinging(), "time_s", 50, 0.245), "does not increase in row 50"),
        (scaled(swinging(), "time_s", 1e3), "'time_s' steps by 5.*in ms"),
        (scaled(swinging(), "time_s", 1e9), "in ns"),
        (scaled(swinging(), "time_s", 0.1), "one of the two is wrong"),
        (swinging().with_columns(height_m=250.0), r"'height_m' cannot be in m: row 0 .* mm"),
    ],
)
def test_what_cannot_be_used_is_refused(table, sentence):
    with pytest.raises(RecordingError, match=f"log.csv.*{sentence}"):
        load(table)


POSITIONS = ["hip_position_rad", "knee_position_rad"]
VELOCITIES = ["hip_velocity_rad_s", "knee_velocity_rad_s"]
COMMANDS = ["hip_position_command_rad", "knee_position_command_rad"]
DEGREES = 180 / np.pi


@pytest.mark.parametrize(
    ("columns", "factor", "sentence"),
    [
        (POSITIONS, DEGREES, r"'hip_position_rad' cannot be in rad: row \d+ .* degrees"),
        ([*POSITIONS, *VELOCITIES, *COMMANDS], DEGREES, ".* degrees"),
        (VELOCITIES, DEGREES, r"'knee_velocity_rad_s' cannot be in rad/s: row \d+ .* degrees/s"),
        (VELOCITIES[:1], DEGREES, "'hip_velocity_rad_s' seems to be in degrees/s.* row"),
        (VELOCITIES, 1 / (2 * np.pi), "'hip_velocity_rad_s' seems to be in revolutions/s.* row"),
        (VELOCITIES, 60 / (2 * np.pi), "'hip_velocity_rad_s' seems to be in rpm.* row"),
        (POSITIONS, 1 / (2 * np.pi), "'hip_position_rad' seems to be in revolutions.* row 0"),
        ([*POSITIONS, *VELOCITIES], 1 / (2 * np.pi), "'hip_position_rad' seems .* revolutions"),
        (["knee_torque_nm"], 1e3, r"'knee_torque_nm' cannot be in N m: row \d+ .* mN m"),
        (COMMANDS, 1 / (2 * np.pi), "'hip_position_command_rad' seems to be in revolutions"),
    ],
)
def test_units_that_cannot_be_right_are_refused(columns, factor, sentence):
    with pytest.raises(RecordingError, match=f"log.csv: column {sentence}"):
        load(scaled(swinging(), columns, factor))


@pytest.mark.parametrize("factor", [-1.0, 2.0, 0.5, 6.0 / 9.0])
def test_a_velocity_that_is_no_derivative_is_left_out(factor):
    recording = load(scaled(swinging(), "knee_velocity_rad_s", factor))
    warning = one_warning(recording)
    assert "'knee_velocity_rad_s' is not the derivative" in warning
    assert "row " in warning
    assert np.isnan(recording.array("velocity")[:, 1]).all()
    assert np.isfinite(recording.array("velocity")[:, 0]).all()


def stalled():
    time = swinging()["time_s"].to_numpy().copy()
    time[200:] += 0.02
    return swinging().with_columns(time_s=time)


def of_another_time():
    velocity = np.roll(swinging()["knee_velocity_rad_s"].to_numpy(), 60)
    return swinging().with_columns(knee_velocity_rad_s=velocity)


@pytest.mark.parametrize(
    ("table", "sentence"),
    [
        (stalled(), "before row 200"),
        (scaled(swinging(), [*POSITIONS, *VELOCITIES, *COMMANDS], 0.159), "not in revolutions"),
        (of_another_time(), "is not the derivative"),
        (swinging().drop(POSITIONS[1], VELOCITIES[1]), f"'{POSITIONS[1]}' was not recorded"),
    ],
)
def test_what_is_strange_is_said_once(table, sentence):
    assert sentence in one_warning(load(table))


def test_quantised_positions_still_have_their_velocity():
    coarse = swinging().with_columns((pl.col(POSITIONS) / 3e-3).round() * 3e-3)
    assert load(coarse).warnings == ()
