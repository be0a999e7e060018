import numpy as np
import polars as pl
import pytest

from hopping_leg.controllers.registry import load_controller
from hopping_leg.controllers.rollout import RolloutConfig, rollout
from hopping_leg.errors import TraceError
from hopping_leg.robot import kinematics, load_robot
from hopping_leg.trace import Trace
from hopping_leg.viewer.tracks import FIELDS, Track, load_track, trace_rows

ROBOT = load_robot("legv2-paper")


def rows(count, **given):
    values = np.zeros((len(FIELDS), count))
    for name, entry in given.items():
        values[FIELDS.index(name)] = entry
    return values


def hardware_trace(**columns):
    count = len(next(iter(columns.values())))
    nothing = np.full(count, np.nan)
    usual = {
        "time_s": np.arange(count) / 200,
        "command_m": np.full(count, 0.3),
        "height_m": nothing,
        "hip_position_rad": np.full(count, 0.8),
        "knee_position_rad": np.full(count, -1.6),
    }
    return Trace(pl.DataFrame(usual | columns))


@pytest.fixture(scope="module")
def simulated():
    controller = load_controller("energy-shaping", ROBOT)
    run = rollout(controller, RolloutConfig(ROBOT, threads=1), np.full((300, 1), 0.3), seed=0)
    return run.trace(0)


def test_a_bounded_track_keeps_its_newest_rows_in_order():
    track = Track("x", ROBOT, depth=10)
    for tick in range(137):
        track.append(tick / 200, rows(1, height_m=float(tick))[:, 0])
    assert 10 <= len(track) <= 20
    newest = np.arange(137 - len(track), 137)
    np.testing.assert_allclose(track.time, newest / 200)
    np.testing.assert_array_equal(track.field("height_m"), newest)
    unbounded = Track("x", ROBOT)
    for part in range(5):
        unbounded.extend(np.arange(2000) + 2000.0 * part, rows(2000))
    np.testing.assert_array_equal(unbounded.time, np.arange(10000.0))


def test_a_moment_between_rows_lies_between_them():
    track = Track("x", ROBOT)
    track.extend(np.array([0.0, 1.0]), rows(2, height_m=[0.2, 0.4], knee_position_rad=[-1, -2]))
    height, q = track.moment(0.25)
    assert height == pytest.approx(0.25)
    np.testing.assert_allclose(q, [0.0, -1.25])


def test_samples_outside_the_rows_are_unknown():
    track = Track("x", ROBOT)
    track.extend(np.array([1.0, 2.0]), rows(2, command_m=[0.3, 0.4]))
    found = track.sample(np.array([0.9, 1.0, 1.9, 2.0, 2.1]))["command_m"]
    np.testing.assert_array_equal(found, [np.nan, 0.3, 0.3, 0.4, np.nan])
    assert track.latest("command_m", 5.0) == 0.4
    assert np.isnan(track.latest("command_m", 0.5))


def test_a_simulated_trace_is_shown_as_recorded(simulated, tmp_path):
    path = tmp_path / "run.parquet"
    simulated.save(path)
    track = load_track(path, ROBOT)
    assert track.name == "energy-shaping"
    assert track.note == ""
    np.testing.assert_array_equal(track.field("height_m"), simulated.column("height_m"))
    _, apexes = track.apexes(1.5, 1.5)
    assert len(apexes)
    assert np.all(apexes > 0.2)


def test_an_estimate_stands_in_for_the_height():
    trace = hardware_trace(estimated_height_m=[0.31, np.nan])
    _, values, note = trace_rows(trace, ROBOT)
    height = values[FIELDS.index("height_m")]
    assert height[0] == 0.31
    assert height[1] == pytest.approx(kinematics.stance_height(ROBOT, np.array([0.8, -1.6])))
    assert "estimate" in note


@pytest.mark.parametrize(
    ("before", "expected"), [(None, [1.0, 1.0, 1.0, 2.0]), ((0.5, -1.0), [0.5, 1.0, 1.0, 2.0])]
)
def test_missing_angles_stay_as_they_were(before, expected):
    trace = hardware_trace(hip_position_rad=[np.nan, 1.0, np.nan, 2.0])
    _, values, _ = trace_rows(trace, ROBOT, before)
    np.testing.assert_array_equal(values[FIELDS.index("hip_position_rad")], expected)


def test_nothing_is_refused(tmp_path):
    with pytest.raises(TraceError, match="no rows"):
        Track("x", ROBOT).moment(0.0)
    path = tmp_path / "empty.parquet"
    hardware_trace(hip_position_rad=np.zeros(0)).save(path)
    with pytest.raises(TraceError, match="no tick"):
        load_track(path, ROBOT)
