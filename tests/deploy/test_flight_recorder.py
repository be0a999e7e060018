import errno
import os
import time

import numpy as np
import pytest

from hopping_leg.deploy.flight_recorder import FlightRecorder
from hopping_leg.errors import TraceError
from hopping_leg.flight_recording import MAGIC, recover
from hopping_leg.trace import Trace

COLUMNS = ("time_s", "command_m", "hip_position_rad")


@pytest.fixture
def path(tmp_path):
    """A recording of five ticks."""
    box = FlightRecorder(tmp_path / "a.blackbox", COLUMNS, {"robot": "legv2"})
    for tick in range(5):
        box.row([tick * 0.005, 0.3, 1.0 + tick])
    box.event(time_s=0.01, state="damping", reason="operator_stop")
    box.close()
    return box.path


def test_what_was_recorded_comes_back_as_a_trace(path):
    trace = recover(path)
    np.testing.assert_allclose(trace.column("hip_position_rad"), [1, 2, 3, 4, 5])
    assert np.isnan(trace.column("height_m")).all()
    assert trace.header["events"][0]["reason"] == "operator_stop"
    trace.save(path.with_suffix(".parquet"))
    assert Trace.load(path.with_suffix(".parquet")).header["robot"] == "legv2"


def ticks(path):
    try:
        return recover(path).table.height
    except TraceError as error:
        return 0 if "no tick" in str(error) else -1


def test_a_recording_cut_at_any_byte_holds_its_whole_ticks_and_no_other(path):
    whole = path.read_bytes()
    ends = range(len(MAGIC), len(whole) + 1)
    seen = [ticks(path) for end in ends if path.write_bytes(whole[:end])]
    assert ({*np.diff(seen)}, seen[0], seen[-1]) == ({0, 1}, 0, 5)


def test_damage_ends_the_record_and_is_never_data(path):
    content = bytearray(path.read_bytes())
    content[content.index(b"}}") + 6 + 20] ^= 1
    path.write_bytes(content)
    with pytest.raises(TraceError, match="no tick"):
        recover(path)


class Disk:
    """Takes so many bytes of each write as ``takes`` says, all if it is None; 0 is a full disk."""

    def __init__(self, monkeypatch):
        self.takes, self._write = None, os.write
        monkeypatch.setattr("hopping_leg.deploy.flight_recorder.os.write", self)

    def __call__(self, file, data):
        takes = len(data) if self.takes is None else self.takes
        if takes == 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        return self._write(file, bytes(data[:takes]))


@pytest.mark.parametrize("threaded", [True, False])
def test_a_full_disk_never_stops_the_loop_and_once_there_is_room_nothing_is_missing(
    tmp_path, monkeypatch, threaded
):
    disk = Disk(monkeypatch)
    box = FlightRecorder(tmp_path / "a.blackbox", COLUMNS, {}, threaded=threaded)
    for tick in range(300):
        disk.takes = {100: 7, 150: 0, 250: None}.get(tick, disk.takes)
        began = time.monotonic()
        box.row([float(tick), 0.0, 0.0])
        assert time.monotonic() - began < 0.5
        time.sleep(0.001)
    box.close()
    assert (box.rows, box.lost) == (300, 0)
    assert "No space" in box.error
    np.testing.assert_array_equal(recover(box.path).column("time_s"), np.arange(300))


@pytest.mark.parametrize("room_again", [True, False])
def test_what_waits_for_a_full_disk_takes_bounded_memory_and_what_is_lost_is_counted(
    tmp_path, monkeypatch, room_again
):
    disk = Disk(monkeypatch)
    monkeypatch.setattr("hopping_leg.deploy.flight_recorder._WAITING", 1000)
    box = FlightRecorder(tmp_path / "a.blackbox", COLUMNS, {})
    disk.takes = 0
    for _ in range(100):
        box.row([0.0, 0.0, 0.0])
    while not box._queue.empty():
        time.sleep(0.01)
    disk.takes = None if room_again else 0
    box.close()
    kept = ticks(box.path)
    assert (0 < kept <= 1000 / 33) if room_again else kept == 0
    assert box.lost == 100 - kept


@pytest.mark.parametrize("takes", [0, 20])
def test_a_recording_that_cannot_begin_is_refused(tmp_path, monkeypatch, takes):
    Disk(monkeypatch).takes = takes
    with pytest.raises(TraceError, match="Cannot write"):
        FlightRecorder(tmp_path / "a.blackbox", COLUMNS, {})
    assert not list(tmp_path.iterdir())


def test_foreign_and_missing_files_get_a_sentence(path):
    with pytest.raises(TraceError, match="Cannot create"):
        FlightRecorder(path, COLUMNS, {})
    path.write_text("hello")
    with pytest.raises(TraceError, match="is no flight recording"):
        recover(path)
    path.unlink()
    with pytest.raises(TraceError, match="Cannot read"):
        recover(path)
