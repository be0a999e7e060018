import numpy as np
import polars as pl
import pytest

from hopping_leg.controllers.registry import load_controller
from hopping_leg.deploy.flight_recorder import FlightRecorder
from hopping_leg.deploy.loop import columns
from hopping_leg.errors import RobotError, TraceError, UsageError
from hopping_leg.flight_recording import SUFFIX
from hopping_leg.robot import kinematics, load_robot
from hopping_leg.trace import Trace
from hopping_leg.viewer.tracks import FIELDS, RecorderSource, ReplaySource, Track

ROBOT = load_robot("legv2-paper")
COLUMNS = ("time_s", "command_m", "hip_position_rad", "knee_position_rad", "hip_torque_nm")


def box(path, robot="legv2"):
    """A recorder whose rows are on disk at once."""
    facts = {"robot": robot, "controller": "fast"}
    return FlightRecorder(path, COLUMNS, facts, threaded=False)


def write(writer, first, count, hip=0.8):
    for tick in range(first, first + count):
        writer.row((tick / 200, 0.3, hip, -1.6, 1.5))


def finished(path, count, **header):
    writer = box(path, **header)
    write(writer, 0, count)
    writer.close()
    return path


def test_a_growing_file_cut_at_any_byte_is_followed_without_error_or_false_row(tmp_path):
    whole = box(tmp_path / "whole")
    write(whole, 0, 8)
    whole.event(what="a transition")
    write(whole, 8, 8, hip=0.9)
    whole.close()
    growing = tmp_path / f"growing{SUFFIX}"
    growing.touch()
    follow, seen = RecorderSource(growing), []
    with growing.open("ab", buffering=0) as file:
        for byte in whole.path.read_bytes():
            file.write(bytes([byte]))
            follow.advance(1 / 60)
            seen.append(len(follow.tracks[0]) if follow.tracks else 0)
    (track,) = follow.tracks
    assert track.name == "fast"
    assert np.unique(seen).tolist() == list(range(17)), "every row appears once it is whole"
    assert seen == sorted(seen)
    np.testing.assert_array_equal(track.time, np.arange(16) / 200)
    np.testing.assert_array_equal(track.field("hip_position_rad"), np.repeat([0.8, 0.9], 8))
    np.testing.assert_array_equal(track.field("knee_position_rad"), -1.6)


def test_a_run_is_shown_as_it_grows_until_it_is_over(tmp_path):
    path = tmp_path / f"fast-1{SUFFIX}"
    writer = box(path)
    follow = RecorderSource(path)
    follow.advance(1 / 60)
    assert follow.tracks == []
    write(writer, 0, 7, hip=0.9)
    follow.advance(1 / 60)
    (track,) = follow.tracks
    assert follow.now == pytest.approx(6 / 200)
    height, q = track.moment(follow.now)
    np.testing.assert_allclose(q, [0.9, -1.6])
    assert height == pytest.approx(kinematics.stance_height(load_robot("legv2"), q))
    assert "standing" in track.note
    write(writer, 7, 3, hip=float("nan"))
    follow.advance(1 / 60)
    assert track.moment(follow.now)[1][0] == 0.9, "joints without a reply stay as they were"
    writer.close()
    path.unlink()
    follow.advance(1.0)
    assert follow.notices[-1].startswith("The run is over")
    assert len(track) == 10


def test_what_hop_deploy_records_is_shown_with_the_estimate_of_the_controller(tmp_path):
    names = columns(load_controller("energy-shaping", ROBOT))
    header = {"robot": ROBOT.name, "controller": "es"}
    writer = FlightRecorder(tmp_path / f"es-1{SUFFIX}", names, header)
    seen = {"hip_position_rad": 0.7, "knee_position_rad": -1.4, "knee_torque_nm": 3.0}
    for tick, estimate in enumerate((float("nan"), 0.33)):
        told = {"time_s": tick / 200, "estimated_height_m": estimate, "height_m": np.nan}
        writer.row(list((dict.fromkeys(names, 0.0) | seen | told).values()))
    writer.close()
    follow = RecorderSource(tmp_path)
    follow.advance(1.0)
    (track,) = follow.tracks
    standing = kinematics.stance_height(ROBOT, np.array([0.7, -1.4]))
    assert [track.moment(tick / 200)[0] for tick in (0, 1)] == [pytest.approx(standing), 0.33]
    assert track.latest("knee_torque_nm", follow.now) == 3.0
    assert "estimate" in track.note


def test_a_folder_waits_for_a_run_and_turns_to_a_newer_one(tmp_path):
    follow = RecorderSource(tmp_path)
    follow.advance(1.0)
    assert "Waiting" in follow.notices[0]
    for number, count in ((1, 3), (2, 5)):
        finished(tmp_path / f"fast-{number}{SUFFIX}", count)
        follow.advance(1.0)
        assert len(follow.tracks[0]) == count
    assert follow.notices[-1] == f"Following fast-2{SUFFIX}."


def test_what_cannot_be_followed_is_refused(tmp_path):
    with pytest.raises(UsageError, match="There is no"):
        RecorderSource(tmp_path / "none")
    foreign = tmp_path / f"foreign{SUFFIX}"
    foreign.write_bytes(b"something else altogether")
    with pytest.raises(TraceError, match="no flight recording"):
        RecorderSource(foreign).advance(1.0)
    unknown = RecorderSource(finished(tmp_path / f"unknown{SUFFIX}", 1, robot="mine"))
    with pytest.raises(RobotError, match="--robot"):
        unknown.advance(1.0)


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
