"""Whatever program wrote a table, it reads the same or is named for what it is."""

import gzip
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.io import savemat

from hopping_leg.errors import RecordingError
from hopping_leg.identify.csv_table import read_csv
from hopping_leg.identify.recording import load_recording
from tests.identify.runs import rig_log

NAMES = ["time_s", "hip_position_rad", "knee_torque_nm"]
UNITS = [["s", "rad", "N m"], ["[s]", "[rad]", "[Nm]"], ["(sec)", "", "N·m"]]
COMMENTS = ["", "# made by a logger", "% leg 2; second run"]


@settings(max_examples=60)
@given(
    rows=st.lists(
        st.tuples(*[st.floats(-1e3, 1e3).map(lambda x: float(f"{x:.6g}"))] * 3), min_size=1
    ),
    mark=st.sampled_from([",", ";", "\t", " ", "  "]),
    comma=st.booleans(),
    hidden=st.booleans(),
    units=st.sampled_from([None, *UNITS]),
    comments=st.lists(st.sampled_from(COMMENTS), max_size=3),
    end=st.sampled_from(["\n", "\r\n"]),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "utf-16"]),
    packed=st.booleans(),
    last=st.sampled_from(["", "rows", "all"]),
)
def test_every_dialect_reads_the_same(
    rows, mark, comma, hidden, units, comments, end, encoding, packed, last
):
    blank = mark.startswith(" ")
    last = "" if hidden else last
    lines = [*comments, ("# " if hidden else "") + mark.join(NAMES) + mark * (last == "all")]
    if units and not hidden and not blank:
        lines.append(mark.join(units))
    for row in rows:
        fields = [repr(value) for value in row]
        if comma and mark != "," and not (hidden and blank):
            fields = [field.replace(".", ",") for field in fields]
        lines += [mark.join(fields) + mark * bool(last), *comments[:1]]
    content = end.join(lines).encode(encoding)
    table = read_csv(gzip.compress(content) if packed else content, "log.csv")
    assert table.columns == NAMES
    np.testing.assert_array_equal(table.to_numpy(), rows)


@pytest.mark.parametrize("mark", [",", ";", "\t"])
def test_a_field_without_a_value_is_null_wherever_it_stands(mark):
    text = "a,b\n,1\n2,\n3,4\n".replace(",", mark)
    assert read_csv(text.encode(), "log.csv").rows() == [(None, 1), (2, None), (3, 4)]


@pytest.mark.parametrize(
    ("suffix", "write", "named"),
    [
        ("npz", lambda path: np.savez(path, time=np.zeros(3)), r"\.npz"),
        ("npy", lambda path: np.save(path, np.zeros(3)), "numpy array"),
        ("pkl", lambda path: path.write_bytes(pickle.dumps({"time": 1})), "never opened"),
        ("mat", lambda path: savemat(path, {"time": np.zeros(3)}), "MATLAB"),
        ("h5", lambda path: path.write_bytes(b"\x89HDF\r\n\x1a\n"), "HDF5"),
    ],
)
def test_what_is_no_table_is_named(tmp_path, suffix, write, named):
    path = tmp_path / f"log.{suffix}"
    write(path)
    with pytest.raises(RecordingError, match=rf"log\.{suffix} is .*{named}.*CSV or Parquet"):
        load_recording(path)


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("0,1\n1,2\n", "has no header"),
        ("time_s,q\nms,deg\n0,1\n", "column 'time_s', row 0: 'ms' is no number"),
        ("# nothing\n", "is empty"),
        ("a,a\n1,2\n", "'a' is nameless or there twice"),
        ("a;b\n1;2\n3\n", "row 1 has 1 fields but the header names 2"),
    ],
)
def test_what_is_wrong_with_a_table_is_named(text, named):
    with pytest.raises(RecordingError, match=named):
        read_csv(text.encode(), "log.csv")


@pytest.mark.parametrize("clock", ["t", "time"])
def test_a_rigs_own_log_is_known_by_either_name_of_its_clock(tmp_path, clock):
    path = tmp_path / "log.csv"
    table = rig_log(clock)
    table.write_csv(path)
    assert load_recording(path).metadata.robot == "doublependulum"
    other = tmp_path / "designC0_run.csv"
    table.write_csv(other)
    with pytest.raises(RecordingError, match=r"design C\.0.*another robot.*sidecar"):
        load_recording(other)
