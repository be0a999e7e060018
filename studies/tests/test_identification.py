import json

import pytest

from hopping_leg.errors import UsageError
from hopping_leg.robot import COARSE_TIMESTEP, load_robot
from studies.identification.known import FIXED, compare, identify_twin, summary
from studies.identification.real import real
from studies.identification.real_leg import jackknife, named, robot_tree, worse
from studies.identification.run import Identify, bars
from studies.identification.study import Study
from studies.identification.twin import AIR, record, twin
from studies.shared import main


def test_twins_are_recorded_with_a_finer_step_than_fits_take():
    assert record(AIR, "swings", 16.0).trace.header["timestep_s"] < COARSE_TIMESTEP


def test_errors_are_relative_to_the_truth_and_claims_are_counted():
    rows = compare({"hip.friction": 0.111, "drive.delay": 1e-4}, {"hip.friction": 0.11}, ["x"])
    assert rows[0]["error_percent"] == pytest.approx(100 / 110)
    assert rows[1]["error_percent"] is None
    assert summary(rows)["identifiable"] == 0
    told = summary(compare({"hip.friction": 0.111}, {"hip.friction": 0.11}, ["hip.friction"]))
    assert told["worst_identifiable_error_percent"] == pytest.approx(100 / 110)


def test_bars_know_which_side_is_better():
    errors = (([0.010, 0.030], [0.020, None]), ([0.011, 0.020], [0.034, None]))
    names = ("predicted_0_2_s_rms_rad", "predicted_0_5_s_rms_rad")
    rows = [
        {"rig": "double pendulum", "held_out": "b"} | dict(zip(names, row, strict=True))
        for row in errors
    ]
    arms = {"share_inside": 0.95, "fit_longest_s": 12.0}
    found = bars({"coverage": arms, "recordings": {"rows": rows}})
    assert [row["reached"] for row in found] == [True, False, False, True, False]
    assert found[0]["measured"] == pytest.approx(11.0)


def test_bad_input_is_one_sentence(tmp_path):
    with pytest.raises(UsageError, match=r"'physics'.*synthetic"):
        Identify(parts=("physics",)).measure()
    with pytest.raises(UsageError, match="legv2_fixed_base"):
        real(Study(), tmp_path)
    assert main("identification", Identify, ["--population", "1"]) == 2
    assert main("identification", Identify, ["--seconds", "8"]) == 2


@pytest.mark.slow
def test_the_command_measures_keeps_and_goes_on(tmp_path):
    file = tmp_path / "identify.json"
    words = ["--parts", "paper-size", "--population", "4", "--generations", "2"]
    words += ["--searches", "two-pass", "--paper-seconds", "16"]
    places = ["--out", str(tmp_path / "kept"), "--json", str(file)]
    assert main("identification", Identify, [*words, *places]) == 0
    first = json.loads(file.read_text())
    assert [row["bar"] for row in first["bars"]] == [90.0]
    assert "--paper-seconds 16" in first["command"]
    assert main("identification", Identify, [*words, *places]) == 0
    assert json.loads(file.read_text())["paper_size"] == first["paper_size"]


@pytest.mark.slow
def test_a_known_twin_is_found():
    row = identify_twin(Study(threads=1), FIXED, "least-squares")
    assert row["worst_identifiable_error_percent"] < 0.5
    assert row["identifiable"] == 8
    assert row["other_swings_rms_rad"] < 1e-3
    assert twin(AIR) != load_robot("legv2")


@pytest.mark.slow
def test_intervals_hold_the_truth_of_independent_arms(tmp_path):
    result = Identify(arms=12, seed=500, parts=("coverage",), out=tmp_path).measure()
    assert result["coverage"]["share_inside"] > 0.9


def test_leaving_one_out_tells_an_interval():
    assert jackknife([2.0, 2.0, 2.0]) == 0.0
    assert jackknife([1.0, 3.0]) == pytest.approx(1.96)  # of two, half their distance


def test_a_leg_is_worse_where_one_joint_on_one_rig_is():
    row = {"rig": "boom", "joint": "hip", "error": "position, rad", "before": 1.0, "after": 0.5}
    better = [row, {**row, "error": "torque, N m", "after": 1.5}]
    assert not worse(better)
    said = worse([*better, {**row, "rig": "fixed-base", "joint": "knee", "after": 1.2}])
    assert said == ["fixed-base: the knee errs 1.2 times as much as by the CAD."]


def test_the_robot_file_has_what_is_the_robots():
    found = named({"knee.friction": 0.2, "drive.delay": 2e-3, "boom.weight": 1.0})
    parameters = [
        {"name": name, "rig": "B", "value": value, "half_width": 0.5 * value, "unit": "x"}
        for name, value in found.items()
    ]
    tree = robot_tree({"parameters": parameters})
    assert tree["knee"]["friction"]["source"] == "[B] 95 % interval 0.1 to 0.3"
    assert tree["reality"]["latency"]["command"]["value"] == 2e-3
    assert "boom" not in tree
