import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from hopping_leg.deploy.flight_recorder import FlightRecorder, read_recording, recover
from hopping_leg.errors import TraceError
from hopping_leg.trace import Trace

COLUMNS = ("time_s", "command_m", "hip_position_rad")

WRITER = """
import sys, time
from pathlib import Path
from hopping_leg.deploy.flight_recorder import FlightRecorder
box = FlightRecorder(Path(sys.argv[1]), ("time_s", "command_m", "hip_position_rad"), {"robot": "t"})
tick = 0
while True:
    box.row([tick * 0.005, 0.3, float(tick)])
    tick += 1
    time.sleep(0.002)
"""


def write(path):
    box = FlightRecorder(path, COLUMNS, {"robot": "legv2"})
    for tick in range(5):
        box.row([tick * 0.005, 0.3, 1.0 + tick])
    box.event(time_s=0.01, state="damping", reason="operator_stop")
    box.close()


@pytest.fixture
def path(tmp_path):
    """A recording of five ticks."""
    write(tmp_path / "a.blackbox")
    return tmp_path / "a.blackbox"


def test_what_was_recorded_comes_back_as_a_trace(path):
    trace = recover(path)
    np.testing.assert_allclose(trace.column("hip_position_rad"), [1, 2, 3, 4, 5])
    assert np.isnan(trace.column("height_m")).all()
    assert trace.header["events"][0]["reason"] == "operator_stop"
    trace.save(path.with_suffix(".parquet"))
    assert Trace.load(path.with_suffix(".parquet")).header["robot"] == "legv2"


def test_cut_anywhere_it_gives_all_whole_rows_before_the_cut(path):
    content = path.read_bytes()
    first = content.index(b"}}") + 2 + 4
    size = 5 + 8 * len(COLUMNS) + 4
    for cut in range(first, len(content)):
        path.write_bytes(content[:cut])
        box, rows = read_recording(path)
        assert len(rows) == min((cut - first) // size, 5)
        assert box.whole is (cut in {first + n * size for n in range(6)})


def test_damage_ends_the_record_and_is_never_data(path):
    content = bytearray(path.read_bytes())
    content[content.index(b"}}") + 6 + 20] ^= 1
    path.write_bytes(content)
    assert len(read_recording(path)[1]) == 0
    with pytest.raises(TraceError, match="no tick"):
        recover(path)


def test_a_killed_process_leaves_what_it_recorded(tmp_path):
    path = tmp_path / "killed.blackbox"
    words = [sys.executable, "-c", WRITER, str(path)]
    with subprocess.Popen(words, stdout=subprocess.DEVNULL) as process:
        deadline = time.monotonic() + 60
        while not path.exists() or not path.stat().st_size or len(read_recording(path)[1]) < 50:
            assert time.monotonic() < deadline, "rows reach the file only when it is closed"
            time.sleep(0.01)
        os.kill(process.pid, signal.SIGKILL)
    found = recover(path).column("hip_position_rad")
    assert len(found) >= 50
    np.testing.assert_array_equal(found, np.arange(len(found)))


def test_a_full_disk_never_stops_the_loop(tmp_path):
    if not Path("/dev/full").exists():
        pytest.skip("no /dev/full")
    box = FlightRecorder(tmp_path / "a.blackbox", COLUMNS, {})
    full = os.open("/dev/full", os.O_WRONLY)
    os.dup2(full, box._file)
    start = time.monotonic()
    for _ in range(100):
        box.row([0.0, 0.0, 0.0])
    assert time.monotonic() - start < 1
    box.close()
    os.close(full)
    assert "No space" in box.error


def test_foreign_and_missing_files_get_a_sentence(path):
    with pytest.raises(TraceError, match="Cannot create"):
        write(path)
    path.write_text("hello")
    with pytest.raises(TraceError, match="is no flight recording"):
        read_recording(path)
    path.unlink()
    with pytest.raises(TraceError, match="Cannot read"):
        read_recording(path)
