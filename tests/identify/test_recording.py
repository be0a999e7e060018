import gzip
import hashlib

import numpy as np
import polars as pl
import pytest

from hopping_leg.errors import HoppingLegError, RecordingError, UsageError
from hopping_leg.identify.columns import COLUMNS, PAIRS
from hopping_leg.identify.recording import load_recording, make_recording, with_metadata
from hopping_leg.trace import Trace
from tests.identify.runs import METADATA, SIDECAR, swinging, write_run


def test_a_clean_run_is_read_without_a_word(tmp_path):
    table = swinging()
    recording = load_recording(write_run(tmp_path, table))
    assert recording.warnings == ()
    assert recording.metadata == METADATA
    assert recording.name == "run.csv"
    np.testing.assert_allclose(recording.time, table["time_s"])
    np.testing.assert_allclose(
        recording.array("position"), table.select(PAIRS["position"]).to_numpy()
    )
    assert recording.array("stiffness").shape == (600, 2)
    assert np.isnan(recording.array("stiffness")).all()
    assert recording.has("torque")
    assert not recording.has("velocity_command")
    assert recording.exact_time.all()
    assert recording.segments() == [slice(0, 600)]


def test_the_native_form_keeps_everything(tmp_path):
    first = load_recording(write_run(tmp_path, swinging()))
    first = with_metadata(first, stiffness=(2.0, 30.0), torque_limit=(10.0, 20.0), startup_rows=4)
    path = tmp_path / "native.parquet"
    first.save(path)
    back = load_recording(path)
    assert back.metadata == first.metadata
    assert back.trace.table.equals(first.trace.table[4:])
    assert back.digest == hashlib.sha256(path.read_bytes()).hexdigest()
    back.save(tmp_path / "again.parquet")
    assert load_recording(tmp_path / "again.parquet").trace.table.equals(back.trace.table)


def test_gzip_plain_and_foreign_parquet_read_the_same(tmp_path):
    path = write_run(tmp_path, swinging())
    plain = load_recording(path)
    packed = tmp_path / "run.csv.gz"
    packed.write_bytes(gzip.compress(path.read_bytes()))
    foreign = tmp_path / "run.parquet"
    pl.read_csv(path).write_parquet(foreign)
    assert load_recording(packed).trace.table.equals(plain.trace.table)
    assert load_recording(foreign).trace.table.equals(plain.trace.table)


def test_a_sidecar_may_name_the_columns(tmp_path):
    own = swinging().rename({"hip_position_rad": "alpha", "time_s": "stamp"})
    sidecar = SIDECAR + '[columns]\nhip_position_rad = "alpha"\ntime_s = "stamp"\n'
    recording = load_recording(write_run(tmp_path, own, sidecar))
    assert recording.has_column("hip_position_rad")
    assert not recording.has_column("alpha")


@pytest.mark.parametrize(
    ("sidecar", "sentence"),
    [
        ("rig = ", "run.toml is not valid TOML"),
        (SIDECAR + "[columns]\nheight = 'x'", "no recording column 'height'"),
        (SIDECAR + "[columns]\nheight_m = 'x'", "no column 'x'"),
        (SIDECAR + "columns = 3", r"\[columns\] must name"),
        ('rig = "rail"', "'rate_hz' is missing"),
        (SIDECAR.replace("fixed-base", "fixed base"), "Did you mean 'fixed-base'"),
        (SIDECAR.replace("200.0", "0"), "'rate_hz' is 0.0 but must be positive"),
        (SIDECAR.replace("200.0", '"fast"'), "'rate_hz' is 'fast' but must be a finite number"),
        (SIDECAR + "rate = 3", "Did you mean 'rate_hz'"),
        (SIDECAR + "stiffness = 3", "'stiffness' is 3 but must be a pair"),
        (SIDECAR + "stiffness = [1, -3]", "must hold zero or more"),
        (SIDECAR + "startup_rows = -1", "'startup_rows' is -1 but must be 0 or more"),
        (SIDECAR + "startup_rows = true", "'startup_rows' is True but must be a whole number"),
        (SIDECAR + "gains_exact = 1", "'gains_exact' is 1 but must be true or false"),
        (SIDECAR + "quantisation = 1", "'quantisation' must be a table"),
        (SIDECAR.replace('"made up"', "1"), "'source' is 1 but must be a text"),
    ],
)
def test_a_broken_sidecar_gets_a_sentence(tmp_path, sidecar, sentence):
    with pytest.raises(RecordingError, match=sentence) as caught:
        load_recording(write_run(tmp_path, swinging(), sidecar))
    assert "run.toml" in str(caught.value)


def test_tables_of_unknown_rigs_are_told_what_is_known(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("a,b\n1,2\n")
    with pytest.raises(RecordingError, match=r"legv2_fixed_base.*log\.toml.*a, b"):
        load_recording(path)


def test_traces_that_are_no_recordings_are_refused(tmp_path):
    path = tmp_path / "trace.parquet"
    Trace(swinging()).save(path)
    with pytest.raises(RecordingError, match="no known rig"):
        load_recording(path)


def test_missing_empty_and_truncated_files_get_a_sentence(tmp_path):
    with pytest.raises(RecordingError, match="There is no recording"):
        load_recording(tmp_path / "none.csv")
    with pytest.raises(RecordingError, match="Cannot read"):
        load_recording(tmp_path)
    empty = tmp_path / "empty.csv"
    empty.touch()
    with pytest.raises(RecordingError, match=r"empty\.csv is empty"):
        load_recording(empty)
    whole = tmp_path / "whole.parquet"
    load_recording(write_run(tmp_path, swinging())).save(whole)
    cut = tmp_path / "cut.parquet"
    cut.write_bytes(whole.read_bytes()[:-100])
    with pytest.raises(HoppingLegError, match=r"cut\.parquet is not a readable Parquet"):
        load_recording(cut)


def test_quantities_that_do_not_exist_are_named():
    recording = make_recording(swinging(), METADATA, "made up")
    with pytest.raises(UsageError, match="Did you mean 'position'"):
        recording.array("positon")


def test_segments_end_where_rows_are_missing():
    table = swinging().filter(~pl.int_range(pl.len()).is_in([100, 101, 102, 300]))
    recording = make_recording(table, METADATA, "made up")
    assert recording.segments() == [slice(0, 100), slice(100, 596)]
    assert any("stall of 20.0 ms" in warning for warning in recording.warnings)


def test_a_log_that_keeps_every_fourth_row_has_no_stalls():
    recording = make_recording(swinging(2400)[::4], METADATA, "made up")
    assert recording.segments() == [slice(0, 600)]
    assert recording.warnings == ()


def test_every_pair_has_columns_with_a_meaning():
    assert {c for pair in PAIRS.values() for c in pair} <= set(COLUMNS)
    assert all(meaning for _, meaning in COLUMNS.values())
