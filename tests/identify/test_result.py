import dataclasses
import json

import numpy as np

from hopping_leg.identify.result import as_json
from tests.identify.fitting import TRUTH, identified, run


def test_other_tools_find_the_validation_under_its_names():
    tree = as_json(identified())
    for part in (tree["validation"], tree["start_validation"]):
        assert len(part["closed_loop_position_rms_rad"]) == 2
        assert len(part["closed_loop_torque_rms_nm"]) == 2
        assert list(part["open_loop_position_rms_rad"]) == ["0.2", "0.5", "1.0"]
        assert all(len(pair) == 2 for pair in part["open_loop_position_rms_rad"].values())


def test_the_result_says_what_it_was_made_from():
    tree = as_json(identified())
    assert {r["use"] for r in tree["recordings"]} == {"fit", "judge"}
    assert sum(r["rows"] for r in tree["recordings"]) == len(run())
    assert tree["versions"]["mujoco"]
    assert tree["robot_digest"] == identified().robot.digest
    (one,) = tree["search"]["passes"]
    assert one["history"][-1] == one["cost"]


def test_intervals_hold_their_values():
    rows = {r["name"]: r for r in as_json(identified())["parameters"]}
    assert set(rows) == set(TRUTH)
    for row in rows.values():
        assert row["bound_low"] <= row["value"] <= row["bound_high"]
        assert row["interval_low"] <= row["value"] <= row["interval_high"]
    names = as_json(identified())["correlations"]["names"]
    matrix = np.array(as_json(identified())["correlations"]["matrix"])
    assert names == list(TRUTH)
    np.testing.assert_allclose(np.diag(matrix), 1.0)


def test_what_does_not_exist_is_null():
    known = dataclasses.replace(identified().identifiability, half_width=np.array([np.inf, 1.0]))
    tree = as_json(dataclasses.replace(identified(), identifiability=known))
    assert tree["parameters"][0]["interval_high"] is None
    assert json.loads(json.dumps(tree, allow_nan=False)) == tree


def test_without_a_closed_loop_its_pairs_are_null_and_nobody_tells_of_it():
    nothing = (np.nan, np.nan)
    known = {
        when: dataclasses.replace(
            getattr(identified(), when), closed_loop_position=nothing, closed_loop_torque=nothing
        )
        for when in ("validation", "start_validation")
    }
    tree = as_json(dataclasses.replace(identified(), **known))
    assert tree["validation"]["closed_loop_position_rms_rad"] == [None, None]
    assert tree["validation"]["closed_loop_torque_rms_nm"] == [None, None]
    assert [row["error"] for row in tree["quality"]] == [
        f"position, predicted {horizon} s ahead" for horizon in ("0.2", "0.5", "1")
    ]
