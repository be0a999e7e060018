import numpy as np
import polars as pl
import pytest

from hopping_leg.errors import TraceError
from hopping_leg.io import write_atomically
from hopping_leg.trace import COLUMNS, Trace


def some_trace():
    values = np.random.default_rng(3).normal(size=(7, len(COLUMNS)))
    return Trace(pl.DataFrame(dict(zip(COLUMNS, values.T, strict=True))), {"seed": 3, "robot": "x"})


def test_a_trace_survives_its_file_and_saved_again_has_the_same_bytes(tmp_path):
    trace = some_trace()
    path = tmp_path / "deeper" / "run.parquet"
    trace.save(path)
    back = Trace.load(path)
    assert back.header == trace.header
    assert back.table.equals(trace.table)
    assert back.column("height_m").dtype == np.float64
    some_trace().save(tmp_path / "again.parquet")
    assert (tmp_path / "again.parquet").read_bytes() == path.read_bytes()


def test_a_missing_column_is_named_with_those_that_exist():
    with pytest.raises(TraceError, match=r"no column 'speed'.*height_m"):
        some_trace().column("speed")


def test_missing_foreign_and_truncated_files_are_refused(tmp_path):
    with pytest.raises(TraceError, match="There is no trace file"):
        Trace.load(tmp_path / "none.parquet")
    foreign = tmp_path / "foreign.parquet"
    pl.DataFrame({"a": [1]}).write_parquet(foreign)
    with pytest.raises(TraceError, match="not a trace"):
        Trace.load(foreign)
    whole = tmp_path / "whole.parquet"
    some_trace().save(whole)
    cut = tmp_path / "cut.parquet"
    cut.write_bytes(whole.read_bytes()[:-200])
    with pytest.raises(TraceError, match="not a readable Parquet file"):
        Trace.load(cut)
    pl.DataFrame({"a": [1]}).write_parquet(cut, metadata={"hopping_leg": '{"schema": 0}'})
    with pytest.raises(TraceError, match="schema 0"):
        Trace.load(cut)


def test_a_failed_write_leaves_the_old_file_whole(tmp_path):
    path = tmp_path / "result.json"
    write_atomically(path, b"old")
    (tmp_path / "result.json.part").mkdir()
    with pytest.raises((TraceError, OSError)):
        write_atomically(path, b"new")
    assert path.read_bytes() == b"old"
