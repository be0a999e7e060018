"""Plain data is stored and read as it is, and mistakes in it are one sentence."""

import dataclasses
import json
import math
import os
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import polars as pl
import pytest

from hopping_leg import io, trace
from hopping_leg.errors import RobotError, TraceError, UsageError
from hopping_leg.io import write_atomically
from hopping_leg.trace import COLUMNS, Trace


def test_json_has_null_where_there_is_no_number_and_a_folder_is_no_file(tmp_path):
    file = tmp_path / "deep" / "x.json"
    io.write_json(file, {"a": [math.nan, 1.5, (math.inf,)], "b": None, "\u03c4": [True, 7, "x"]})
    kept = {"a": [None, 1.5, [None]], "b": None, "\u03c4": [True, 7, "x"]}
    assert json.loads(file.read_text()) == kept
    with pytest.raises(TraceError):
        io.write_json(tmp_path, {})


@dataclass(frozen=True)
class Inner:
    level: Literal["low", "high"] = "low"
    gain: float = field(default=1.0, metadata={"unit": "N m"})

    def __post_init__(self):
        if self.gain < 0:
            raise UsageError(f"'gain' is {self.gain} but must be zero or more.")


@dataclass(frozen=True)
class Outer:
    name: str
    inner: Inner
    pair: tuple[float, float] | None = None


WHOLE = {"name": "x", "inner": {}}


def test_a_dataclass_comes_back_from_its_table():
    outer = Outer("x", Inner("high", 2.5), (1.0, 2.0))
    tree = json.loads(json.dumps(dataclasses.asdict(outer)))
    assert io.read_dataclass(Outer, tree, "f") == outer


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"nme": 1}, "f: There is no field 'nme'. Did you mean 'name'?"),
        ({"inner": {"gian": 1}}, "f: There is no field in [inner] 'gian'. Did you mean 'gain'?"),
        ({"inner": 3}, "f: 'inner': Expected `object`, got `int`."),
        ({"inner": {"level": "mid"}}, "f: 'inner.level': There is no value 'mid'."),
        ({"inner": {"gain": -1}}, "f: 'gain' is -1.0 but must be zero or more."),
        ({"inner": {"gain": math.inf}}, "f: 'inner.gain' is inf but must be a finite number."),
    ],
)
def test_mistakes_in_a_table_are_one_sentence_with_the_field(change, sentence):
    with pytest.raises(UsageError) as caught:
        io.read_dataclass(Outer, WHOLE | change, "f")
    assert str(caught.value).startswith(sentence)
    with pytest.raises(RobotError, match="missing required field `inner`"):
        io.read_dataclass(Outer, {"name": "x"}, "f", error=RobotError)


def test_a_text_becomes_a_file_name():
    assert io.safe_file_name("my leg/v2.1") == "my_leg_v2.1"
    assert io.safe_file_name("\x1b" * 300) == "_" * 80


def some_trace():
    values = np.random.default_rng(3).normal(size=(7, len(COLUMNS)))
    return Trace(pl.DataFrame(dict(zip(COLUMNS, values.T, strict=True))), {"seed": 3, "robot": "x"})


def test_a_trace_survives_its_file_and_saved_again_has_the_same_bytes(tmp_path):
    saved = some_trace()
    path = tmp_path / "deeper" / "run.parquet"
    saved.save(path)
    back = Trace.load(path)
    assert back.header == saved.header
    assert back.table.equals(saved.table)
    with pytest.raises(TraceError, match=r"no column 'speed'.*height_m"):
        back.column("speed")
    some_trace().save(tmp_path / "again.parquet")
    assert (tmp_path / "again.parquet").read_bytes() == path.read_bytes()


def test_missing_foreign_and_cut_files_are_refused_in_a_sentence(tmp_path):
    with pytest.raises(TraceError, match="Cannot read the trace"):
        Trace.load(tmp_path / "none.parquet")
    path = tmp_path / "run.parquet"
    pl.DataFrame({"a": [1]}).write_parquet(path)
    with pytest.raises(TraceError, match="not a trace"):
        Trace.load(path)
    pl.DataFrame({"a": [1]}).write_parquet(path, metadata={"hopping_leg": '{"schema": 0}'})
    with pytest.raises(TraceError, match="schema 0"):
        Trace.load(path)
    some_trace().save(path)
    whole = path.read_bytes()
    for end in (0, 3, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:end])
        with pytest.raises(TraceError, match=r"not a readable Parquet file: [^\n]+\.$"):
            Trace.load(path)


def test_a_file_that_would_end_the_process_is_refused(tmp_path, monkeypatch):
    path = tmp_path / "run.parquet"
    some_trace().save(path)
    monkeypatch.setattr(trace, "_READER", "import os; os.abort()")
    trace._reader.cache_clear()
    with pytest.raises(TraceError, match="not a readable Parquet file: it is damaged, or of"):
        Trace.load(path)
    monkeypatch.undo()
    assert Trace.load(path).table.height == 7


def test_a_write_that_is_interrupted_or_fails_leaves_the_old_file_and_nothing_else(
    tmp_path, monkeypatch
):
    path = tmp_path / "result.json"
    write_atomically(path, b"old")
    for error, raised in ((KeyboardInterrupt, KeyboardInterrupt), (OSError, TraceError)):

        def fail(_, error=error):
            raise error

        monkeypatch.setattr(os, "fsync", fail)
        with pytest.raises(raised):
            write_atomically(path, b"new")
        assert [(file, file.read_bytes()) for file in tmp_path.iterdir()] == [(path, b"old")]
