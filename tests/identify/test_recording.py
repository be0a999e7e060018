import dataclasses
import gzip
import hashlib

import numpy as np
import polars as pl
import pytest

from hopping_leg.errors import RecordingError
from hopping_leg.identify.importers import log_format
from hopping_leg.identify.recording import load_recording, make_recording
from tests.identify import runs
from tests.identify.runs import METADATA, SIDECAR, needs_recordings, swinging, write_run

POSITIONS = ["hip_position_rad", "knee_position_rad"]
VELOCITIES = ["hip_velocity_rad_s", "knee_velocity_rad_s"]
COMMANDS = ["hip_position_command_rad", "knee_position_command_rad"]


def test_a_clean_run_is_read_without_a_word(tmp_path):
    table = swinging()
    recording = load_recording(write_run(tmp_path, table))
    assert (recording.name, recording.metadata, recording.warnings) == ("run.csv", METADATA, ())
    shown = np.column_stack([recording.time, recording.array("position")])
    np.testing.assert_allclose(shown, table.select("time_s", *POSITIONS).to_numpy())
    assert np.isnan(recording.array("stiffness")).all()
    assert recording.has("torque")
    assert recording.exact_time.all()
    assert recording.segments() == [slice(0, 600)]


def test_the_native_form_keeps_everything(tmp_path):
    first = load_recording(write_run(tmp_path, swinging()))
    first = first.with_metadata(stiffness=(2.0, 30.0), torque_limit=(10.0, 20.0), startup_rows=4)
    path = tmp_path / "native.parquet"
    first.save(path)
    back = load_recording(path)
    assert back.metadata == first.metadata
    assert back.trace.table.equals(first.trace.table[4:])
    assert back.digest == hashlib.sha256(path.read_bytes()).hexdigest()
    back.save(tmp_path / "again.parquet")
    assert load_recording(tmp_path / "again.parquet").trace.table.equals(back.trace.table)


@pytest.mark.parametrize(
    ("mark", "comment"),
    [(",", ""), (";", "# leg 2"), ("\t", "# leg, 2"), (", ", ""), ("   ", "# leg,  2")],
)
def test_every_form_of_a_table_reads_the_same(tmp_path, mark, comment):
    path = write_run(tmp_path, swinging())
    plain = load_recording(path)
    foreign = tmp_path / "run.parquet"
    pl.read_csv(path).write_parquet(foreign)
    text = f"{comment}\n" + path.read_text().replace(",", mark).replace("\n", "\r\n")
    text = text.replace(".", ",") if mark == ";" else text  # as where decimals have a comma
    other, packed = tmp_path / "run.txt", tmp_path / "run.csv.gz"
    other.write_text(text, encoding="utf-8-sig" if not comment else "utf-8")
    packed.write_bytes(gzip.compress(other.read_bytes()))
    for file in (foreign, other, packed):
        assert load_recording(file).trace.table.equals(plain.trace.table)


@pytest.mark.parametrize(
    ("content", "named"),
    [
        (b"", "no whole table"),
        (b"0,1\n1,2\n", "has no header"),
        (b"a,a\n1,2\n", "equal names"),
        (b"a,b\n1,2\n\n3\n", "row 1 has fewer fields than the 2 of the header"),
        (b"a,b,c\n1,2\n3,4\n", "rows have 2 fields, all others than the 3 names"),
        (b'a\n1,"2,0"\n3,4\n', "rows have 2 fields, all others than the 1 names"),
        (b"# time_s,a\n0,1\n1,2\n", "has no header.*without a #"),
        (gzip.compress(b"a,b\n1,2\n", mtime=0)[:-6], "no whole table"),
        (b"time_s,hip_position_rad\ns,0\n", 'must hold numbers, not ."s".*row of units'),
        (b"time_s,hip_position_rad\n2,0\n1,0\n0,0\n", "not in the order of time; sort them"),
        ("a,b\n1,2\n".encode("utf-16"), "holds zero bytes, as UTF-16, archives"),
    ],
)
def test_what_is_no_table_is_refused(tmp_path, content, named):
    path = write_run(tmp_path, swinging())
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=rf"run\.csv.* {named}"):
        load_recording(path)


@pytest.mark.parametrize("clock", ["t", "time"])
def test_a_rigs_own_log_is_known_by_either_name_of_its_clock(tmp_path, clock):
    path, other = tmp_path / "log.csv", tmp_path / "designC0_run.csv"
    for file in (path, other):
        runs.rig_log(clock).write_csv(file)
    assert load_recording(path).metadata.robot == "doublependulum"
    with pytest.raises(RecordingError, match=r"design C\.0.*another robot.*sidecar"):
        load_recording(other)


def test_commands_that_a_known_rigs_log_calls_desired_are_read(tmp_path):
    names = log_format("legv2_boom").columns
    log = swinging(rate=130.0).with_columns(pl.col(POSITIONS[0]) + 0.7, phase=pl.lit("HOP"))
    log = log.rename({c: own.replace("_cmd", "_des") for c, own in names.items() if c in log})
    log.write_csv(tmp_path / "log.csv")
    assert "hip_tau_des" in log
    assert load_recording(tmp_path / "log.csv").has("torque_command")


def test_a_sidecar_may_name_the_columns(tmp_path):
    own = swinging().rename({"hip_position_rad": "alpha", "time_s": "stamp"})
    sidecar = SIDECAR + '[columns]\nhip_position_rad = "alpha"\ntime_s = "stamp"\n'
    recording = load_recording(write_run(tmp_path, own, sidecar))
    assert [recording.has_column(c) for c in ("hip_position_rad", "alpha")] == [True, False]


@pytest.mark.parametrize(
    ("sidecar", "sentence"),
    [
        (SIDECAR + "[columns]\nheight = 'x'", "no recording column 'height'"),
        (SIDECAR + "[columns]\nheight_m = 'x'", "csv: There is no column 'x'"),
        (SIDECAR + "columns = 3", r"\[columns\] must name"),
        (SIDECAR.replace("fixed-base", "fixed base"), "Did you mean 'fixed-base'"),
        (SIDECAR.replace("200.0", "0"), "'rate_hz' is 0.0 but must be positive"),
        (SIDECAR + "startup_rows = -1", "'startup_rows' is -1 but must be 0 or more"),
    ],
)
def test_a_broken_sidecar_gets_a_sentence(tmp_path, sidecar, sentence):
    with pytest.raises(RecordingError, match=sentence) as caught:
        load_recording(write_run(tmp_path, swinging(), sidecar))
    assert "run.toml" in str(caught.value)


def test_folders_and_tables_of_unknown_rigs_are_told_what_is_known(tmp_path):
    with pytest.raises(RecordingError, match="no bag"):
        load_recording(tmp_path)
    path = tmp_path / "log.csv"
    path.write_text("a,b\n1,2\n")
    with pytest.raises(RecordingError, match=r"legv2_fixed_base.*log\.toml.*a, b"):
        load_recording(path)


def test_segments_end_where_rows_are_missing():
    table = swinging().filter(~pl.int_range(pl.len()).is_in([100, 101, 102, 300]))
    recording = make_recording(table, METADATA, "made up")
    assert recording.segments() == [slice(0, 100), slice(100, 596)]
    assert any("stall of 20.0 ms" in warning for warning in recording.warnings)


FILES = sorted(runs.RECORDINGS.glob("*/*.csv.gz"))


@needs_recordings
@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_real_recordings_are_believed(path):
    recording = load_recording(path)
    rig = log_format(path.parent.name.replace("doublependulum_fixed_base", "doublependulum"))
    assert recording.metadata.source == rig.metadata.source
    assert len(recording) > 700
    assert recording.has("position")
    assert recording.has("velocity")
    known = ("stall", "start-up rows")
    assert all(any(word in warning for word in known) for warning in recording.warnings)
    period = np.median(np.diff(recording.time))
    assert period * recording.metadata.rate_hz == pytest.approx(1, rel=0.02)


@needs_recordings
def test_interpolated_samples_never_count_as_measured():
    path = next((runs.RECORDINGS / "legv2_fixed_base").glob("*seg0*"))
    recording = load_recording(path)
    shares = [np.isfinite(recording.array(q)).mean() for q in ("position", "velocity", "torque")]
    np.testing.assert_allclose(shares, [0.11, 0.18, 0.40], atol=0.06)
    assert np.isfinite(recording.array("position_estimate")).all()
    assert 0.6 < recording.exact_time.mean() < 0.9
    measured, estimate = recording.array("position"), recording.array("position_estimate")
    assert np.nanmax(np.abs(measured - estimate)) < 1e-6


def set_rows(table, column, rows, value):
    values = table[column].to_numpy().copy()
    values[rows] = value
    return table.with_columns(pl.Series(column, values))


def scaled(table, columns, factor):
    return table.with_columns(pl.col(columns) * factor)


def moved(column, by, since=0):
    values = swinging()[column].to_numpy()[since:] + by
    return set_rows(swinging(), column, slice(since, None), values)


def load(table, **metadata):
    return make_recording(table, dataclasses.replace(METADATA, **metadata), "log.csv")


def one_warning(recording):
    (warning,) = recording.warnings
    assert warning.startswith("log.csv: ")
    assert "\n" not in warning
    return warning


FIRST, ALL = "holds uninitialised memory in 2 rows, first in row 7", slice(None)


@pytest.mark.parametrize(
    ("column", "rows", "values", "said"),
    [
        ("hip_torque_nm", [7, 30], -1e-310, FIRST),
        ("hip_torque_nm", [7, 30], np.inf, FIRST),
        ("hip_torque_nm", [7, 30], 1e300, FIRST),
        ("knee_torque_nm", ALL, 0.0, "is zero in all rows"),
        ("knee_velocity_rad_s", ALL, -swinging()["knee_velocity_rad_s"], "is not the derivative"),
        ("knee_velocity_rad_s", ALL, swinging()["knee_velocity_rad_s"] / 1.5, "is not the deriv"),
    ],
)
def test_what_cannot_be_believed_is_left_out_and_nothing_else(column, rows, values, said):
    table, shown = swinging(), load(set_rows(swinging(), column, rows, values))
    assert f"column '{column}' {said}" in one_warning(shown)
    expected = set_rows(table, column, rows, np.nan).fill_nan(None)
    assert shown.trace.table.select(table.columns).equals(expected)


def test_startup_rows_are_left_out_once():
    asleep = swinging()
    for name in POSITIONS:
        asleep = set_rows(asleep, name, slice(0, 4), 0.0)
    for recording, rows in ((load(asleep), 4), (load(swinging(), startup_rows=3), 3)):
        assert f"rows 0 to {rows - 1}" in one_warning(recording)
        assert len(recording) == 600 - rows
        assert recording.time[0] == pytest.approx(rows / 200)


@pytest.mark.parametrize(
    ("table", "sentence"),
    [
        (swinging().drop("time_s"), r"no column 'time_s' among hip.*\[columns\]"),
        (swinging()[:0], "no rows"),
        (swinging()[:15], "too short: 15 rows.*hip_position_rad"),
        (set_rows(swinging(), "time_s", 50, np.nan), "'time_s' has no time in row 50"),
        (set_rows(swinging(), "time_s", 50, 0.1), "'time_s' does not increase in row 50"),
        (set_rows(swinging(), "time_s", 50, 0.245), "does not increase in row 50"),
        (scaled(swinging(), "time_s", 1e3), "'time_s' steps by 5 .in ms.*one of the two is wrong"),
        (swinging().with_columns(height_m=250.0), r"'height_m' cannot be in m: row 0 .* mm"),
        (moved(POSITIONS[0], 0.9, 300), "jumps by .* rad before row 300"),
        (moved(POSITIONS[0], np.pi / 3, 300), "jumps by .* rad before row 300"),
        (moved(POSITIONS[0], 2.5, 300), "jumps by .* rad before row 300"),
        (moved(POSITIONS[1], -1.5), r"'knee_position_rad' is -.*ends at -2\.\d+.*check sign"),
    ],
)
def test_what_cannot_be_used_is_refused(table, sentence):
    with pytest.raises(RecordingError, match=f"log.csv.*{sentence}"):
        load(table)


DEGREES = 180 / np.pi


@pytest.mark.parametrize(
    ("columns", "factor", "sentence"),
    [
        (POSITIONS, DEGREES, r"'hip_position_rad' cannot be in rad: row \d+ .* degrees"),
        ([*POSITIONS, *VELOCITIES, *COMMANDS], DEGREES, ".* degrees"),
        (VELOCITIES, DEGREES, r"'knee_velocity_rad_s' cannot be in rad/s: row \d+ .* degrees/s"),
        (VELOCITIES[:1], DEGREES, "'hip_position_rad' or .*seems to be in degrees"),
        (VELOCITIES, 60 / (2 * np.pi), ".*'hip_velocity_rad_s' seems to be in .*rpm"),
        (POSITIONS, 1 / (2 * np.pi), "'hip_position_rad' or .*seems to be in .*revolutions"),
        (["knee_torque_nm"], 1e3, r"'knee_torque_nm' cannot be in N m: row \d+ .* mN m"),
    ],
)
def test_units_that_cannot_be_right_are_refused(columns, factor, sentence):
    with pytest.raises(RecordingError, match=f"log.csv: column {sentence}"):
        load(scaled(swinging(), columns, factor))
