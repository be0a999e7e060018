"""A search tries shapes of hops as a policy would hop them, and goes on where it was."""

import dataclasses
import json
import math

import numpy as np
import pytest

from hopping_leg.controllers import RolloutConfig, rollout
from hopping_leg.controllers.mpc import HopShape, TrueStateMpc
from hopping_leg.robot import load_robot
from hopping_leg.sim import NO_NOISE
from hopping_leg.workers import ProcessWorkers
from studies.mpc import late
from studies.mpc import run as module
from studies.mpc.late import LateMpc
from studies.mpc.run import Hops, Reach, Search, from_unit, measure, to_unit

ROBOT = load_robot("legv2-identified")
GOOD = Hops(0.3, 0.0, 0.003, 20, 2.0, 0, 0.5, 1.0, 10.0, 0.0, 15.0, 0.05)
BRIEF = {"_HEIGHTS": (0.28, 0.32), "_LEGS": 1, "_SECONDS": 3.0, "_SETTLE": 1.0}


@pytest.fixture
def brief(monkeypatch):
    """Let trials be short and in this process."""
    for name, value in BRIEF.items():
        monkeypatch.setattr(module, name, value)
    monkeypatch.setattr(module, "ProcessWorkers", lambda _: ProcessWorkers(1))


def test_every_searched_number_survives_the_unit_cube():
    point = np.linspace(0.05, 0.95, len(module._SPACE))
    np.testing.assert_allclose(to_unit(from_unit(point)), point)
    again = dataclasses.asdict(from_unit(to_unit(HopShape())))
    for name, value in dataclasses.asdict(HopShape()).items():
        low, high = module._SPACE.get(name, (value, value))
        assert low <= value <= high
        assert abs(again[name] - value) <= 0.0201 * (high - low)


def test_a_point_outside_the_unit_cube_is_a_shape_at_its_edge():
    size = len(module._SPACE)
    assert from_unit(np.full(size, 7.0)) == from_unit(np.ones(size))
    assert from_unit(np.full(size, -7.0)) == from_unit(np.zeros(size))


@pytest.mark.parametrize(
    ("name", "worse"),
    [
        ("std_m", 0.006),
        ("median_error_m", -0.005),
        ("skipped_hops", 2),
        ("flight_fraction", 0.3),
        ("hops_per_s", 1.2),
        ("rms_hip_torque_nm", 2.5),
        ("mean_power_w", 30.0),
        ("outside_limits_fraction", 0.02),
        ("least_clearance_m", 0.005),
        ("peak_knee_speed_rad_s", 25.0),
    ],
)
def test_whatever_is_bad_about_hops_costs(name, worse):
    assert GOOD.cost < dataclasses.replace(GOOD, **{name: worse}).cost < 120


def test_a_leg_that_does_not_hop_costs_most():
    still = dataclasses.replace(GOOD, hops=0, std_m=math.nan, median_error_m=math.nan)
    assert still.cost == 120


def test_late_mpc_hops_by_its_seed_alone():
    commands = np.full((300, 2), 0.3)
    setup = RolloutConfig(ROBOT, NO_NOISE, threads=1)
    controllers = [LateMpc(ROBOT, HopShape(), seed) for seed in (3, 3, 4)]
    runs = [rollout(one, setup, commands, seed=0).data["height_m"] for one in controllers]
    np.testing.assert_array_equal(runs[0], runs[1])
    assert not np.array_equal(runs[0], runs[2])
    assert not np.array_equal(runs[0][:, 0], runs[0][:, 1]), "each leg has errors of its own"


def test_late_mpc_knows_where_the_leg_is_but_for_its_errors_of_velocities(monkeypatch):
    class Noting(LateMpc):
        def look(self):
            known, *rest = super().look()
            looks.append((known, TrueStateMpc.look(self)[0].copy()))
            return known, *rest

    setup = RolloutConfig(ROBOT, NO_NOISE, threads=1)
    error = {}
    for errs in (True, False):
        looks = []
        if not errs:
            monkeypatch.setattr(late, "_SPEED_ERROR", (0.0, 0.0))
            monkeypatch.setattr(late, "_JOINT_SPEED_ERROR", 0.0)
        rollout(Noting(ROBOT, HopShape(), 0), setup, np.full((400, 1), 0.3), seed=0)
        known, true = np.array(looks[100:])[:, :, 0].transpose(1, 0, 2)
        error[errs] = np.median(np.abs(known - true), axis=0)
        late_by = np.median(np.abs(true[2:] - true[:-2]), axis=0)
    assert (error[False] < 0.1 * late_by).all()
    assert (error[True][3:] > 3 * error[False][3:]).all()


def test_mpc_reaches_its_heights_with_the_true_state(brief):
    rows = Reach(robots=(ROBOT.name,)).measure()["rows"]
    assert [row["command_m"] for row in rows][:3] == [0.22, 0.24, 0.26]
    low = [row for row in rows if row["command_m"] <= 0.36]
    assert all(abs(row["median_error_m"]) < 0.003 and row["hops"] >= 3 for row in low)
    assert low[0]["mean_power_w"] < low[-1]["mean_power_w"]


def test_legs_are_measured_height_by_height(brief):
    alone = measure(TrueStateMpc(ROBOT), ROBOT, (0.34,), 0)
    low, high = measure(TrueStateMpc(ROBOT), ROBOT, (0.24, 0.34), 0)
    assert (low.command_m, high.command_m) == (0.24, 0.34)
    assert low.hops_per_s > high.hops_per_s
    assert high.median_error_m == pytest.approx(alone[0].median_error_m, abs=0.003)


def test_a_search_that_was_killed_ends_as_one_that_was_not(brief, tmp_path, monkeypatch):
    def search(folder, generations=2):
        found = Search((ROBOT.name,), generations, population=4, out=tmp_path / folder).measure()
        return json.dumps(found)

    tried, cost = [], module.cost
    monkeypatch.setattr(module, "cost", lambda *task: tried.append(task) or cost(*task))
    whole = search("whole")
    count = len(tried)
    assert count == 2 * 4 + 2
    search("cut", generations=1)
    tried.clear()
    assert search("cut") == whole
    assert len(tried) == 4 + 2, "of the first generation nothing is tried again"
    tried.clear()
    assert search("cut") == whole
    assert len(tried) == 2, "of a finished search only the judgement"


def test_a_search_goes_where_costs_are_low(brief, tmp_path, monkeypatch):
    monkeypatch.setattr(module, "cost", lambda _name, shape, _seed: abs(shape.squat - 0.5))
    found = Search((ROBOT.name,), 12, population=8, out=tmp_path).measure()
    (squat,) = (row for row in found["shape"] if row["name"] == "squat")
    assert abs(squat["found"] - 0.5) < 0.3 * abs(squat["shipped"] - 0.5)
    assert found["costs_mm"]["found"] < found["costs_mm"]["shipped"]
