import numpy as np
import polars as pl
import pytest

from hopping_leg.errors import RobotError, TraceError, UsageError
from hopping_leg.robot import kinematics, load_robot
from hopping_leg.trace import Trace
from hopping_leg.viewer.tracks import FIELDS, ReplaySource, Track

ROBOT = load_robot("legv2-paper")


def stored(path, seconds=1.0, start=0.0, **header):
    ticks = round(seconds * 200) + 1
    columns = {name: np.zeros(ticks) for name in FIELDS}
    columns["time_s"] = start + np.arange(ticks) / 200
    columns["height_m"] = np.linspace(0.2, 0.4, ticks)
    Trace(pl.DataFrame(columns), {"robot": "legv2", "controller": "fast"} | header).save(path)
    return path


def test_a_replay_plays_and_begins_again_and_the_shorter_trace_waits(tmp_path):
    short = stored(tmp_path / "b.parquet", 0.5, robot_digest=load_robot("legv2").digest)
    replay = ReplaySource((stored(tmp_path / "a.parquet", start=7.0, robot_digest="0"), short))
    assert len(replay.notices) == 1
    assert "a.parquet was recorded from other parameters" in replay.notices[0]
    assert replay.length == pytest.approx(1.0)
    replay.advance(0.5)
    assert replay.tracks[0].moment(replay.now)[0] == pytest.approx(0.3)
    replay.advance(0.2)
    assert replay.tracks[1].moment(replay.now)[0] == pytest.approx(0.4)
    replay.advance(0.4)
    assert replay.now == 0.0
    for wanted, shown in ((-1.0, 0.0), (0.3, 0.3), (5.0, 1.0)):
        replay.seek(wanted)
        assert replay.now == pytest.approx(shown)


def test_a_height_that_was_not_measured_is_the_controllers_estimate_or_else_that_of_standing():
    nan, hips = np.nan, [0.7, 0.9, 0.9]  # joints without a reply stay as they were
    seen = {"time_s": [0.0, 5e-3, 0.01], "hip_position_rad": [0.7, 0.9, nan], "height_m": [nan] * 3}
    seen |= {"knee_position_rad": [-1.4] * 3, "estimated_height_m": [nan, 0.33, nan]}
    low, _, lower = standing = kinematics.stance_height(ROBOT, np.array([hips, [-1.4] * 3]).T)
    for shown, word in (([low, 0.33, lower], "estimate"), (standing, "standing")):
        track = Track("x", ROBOT)
        track.extend_by_trace(Trace(pl.DataFrame(seen)))
        np.testing.assert_array_equal(track.field("hip_position_rad"), hips)
        np.testing.assert_allclose(track.field("height_m"), shown)
        assert word in track.note
        seen.pop("estimated_height_m", None)


def test_what_cannot_be_replayed_is_refused_and_an_unknown_robot_asks_for_its_file(tmp_path):
    path = stored(tmp_path / "a.parquet", robot="mine")
    assert ReplaySource((path,), "legv1").tracks[0].robot.name == "legv1"
    with pytest.raises(RobotError, match="--robot"):
        ReplaySource((path,))
    with pytest.raises(UsageError, match="one, or two"):
        ReplaySource((path,) * 3)
    with pytest.raises(TraceError, match="Cannot read the trace"):
        ReplaySource((tmp_path / "none.parquet",))
    with pytest.raises(RobotError, match="cannot hop"):
        ReplaySource((stored(tmp_path / "p.parquet", robot="doublependulum"),))
    empty = tmp_path / "empty.parquet"
    Trace(pl.DataFrame({"time_s": np.zeros(2)})).save(empty)
    with pytest.raises(TraceError, match="no tick"):
        ReplaySource((empty,))


def rows(count, **given):
    values = np.zeros((len(FIELDS), count))
    for name, entry in given.items():
        values[FIELDS.index(name)] = entry
    return values


def test_a_bounded_track_keeps_its_newest_rows_in_order():
    for depth, first in ((10, 27), (0, 0)):
        track = Track("x", ROBOT, depth=depth)
        for tick in range(37):
            track.extend(np.array([tick / 200]), rows(1, height_m=float(tick)))
        np.testing.assert_allclose(track.time, np.arange(first, 37) / 200)
        np.testing.assert_array_equal(track.field("height_m"), np.arange(first, 37))


def test_a_moment_lies_between_its_rows_and_samples_outside_of_them_are_unknown():
    track = Track("x", ROBOT)
    given = {"height_m": [0.2, 0.4], "knee_position_rad": [-1, -2], "command_m": [0.3, 0.4]}
    track.extend(np.array([1.0, 2.0]), rows(2, **given))
    height, q = track.moment(1.25)
    assert height == pytest.approx(0.25)
    np.testing.assert_allclose(q, [0.0, -1.25])
    found = track.sample(np.array([0.9, 1.0, 1.9, 2.0, 2.1]))["command_m"]
    np.testing.assert_array_equal(found, [np.nan, 0.3, 0.3, 0.4, np.nan])
    assert track.latest("command_m", 5.0) == 0.4
    assert np.isnan(track.latest("command_m", 0.5))
