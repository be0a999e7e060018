import numpy as np
import polars as pl
import pytest

from hopping_leg.errors import RobotError, TraceError, UsageError
from hopping_leg.robot import load_robot
from hopping_leg.trace import Trace
from hopping_leg.viewer.data_source import ReplaySource
from hopping_leg.viewer.tracks import FIELDS


def stored(path, seconds=1.0, start=0.0, **header):
    ticks = round(seconds * 200) + 1
    columns = {name: np.zeros(ticks) for name in FIELDS}
    columns["time_s"] = start + np.arange(ticks) / 200
    columns["height_m"] = np.linspace(0.2, 0.4, ticks)
    Trace(pl.DataFrame(columns), {"robot": "legv2", "controller": "fast"} | header).save(path)
    return path


def test_a_replay_plays_and_begins_again(tmp_path):
    replay = ReplaySource((stored(tmp_path / "a.parquet", start=7.0),))
    assert replay.length == pytest.approx(1.0)
    replay.advance(0.5)
    assert replay.tracks[0].moment(replay.now)[0] == pytest.approx(0.3)
    replay.advance(0.6)
    assert replay.now == 0.0


def test_seeking_stays_within_the_trace(tmp_path):
    replay = ReplaySource((stored(tmp_path / "a.parquet"),))
    for wanted, shown in ((-1.0, 0.0), (0.3, 0.3), (5.0, 1.0)):
        replay.seek(wanted)
        assert replay.now == pytest.approx(shown)


def test_two_traces_begin_together_and_the_shorter_one_waits(tmp_path):
    paths = (stored(tmp_path / "a.parquet"), stored(tmp_path / "b.parquet", 2.0, start=3.0))
    replay = ReplaySource(paths)
    replay.seek(1.5)
    heights = [track.moment(replay.now)[0] for track in replay.tracks]
    assert replay.length == pytest.approx(2.0)
    np.testing.assert_allclose(heights, [0.4, 0.35])


def test_other_parameters_are_told(tmp_path):
    digest = load_robot("legv2").digest
    same = stored(tmp_path / "same.parquet", robot_digest=digest)
    other = stored(tmp_path / "other.parquet", robot_digest="0" * 16)
    assert ReplaySource((same,)).notices == []
    assert "other parameters" in ReplaySource((other,)).notices[0]


def test_an_unknown_robot_asks_for_its_file(tmp_path):
    path = stored(tmp_path / "a.parquet", robot="mine")
    with pytest.raises(RobotError, match="--robot"):
        ReplaySource((path,))
    assert ReplaySource((path,), "legv1").tracks[0].robot.name == "legv1"


def test_what_cannot_be_replayed_is_refused(tmp_path):
    path = stored(tmp_path / "a.parquet")
    with pytest.raises(UsageError, match="one, or two"):
        ReplaySource((path,) * 3)
    with pytest.raises(TraceError, match="no trace file"):
        ReplaySource((tmp_path / "none.parquet",))
    with pytest.raises(RobotError, match="cannot hop"):
        ReplaySource((stored(tmp_path / "p.parquet", robot="doublependulum"),))
