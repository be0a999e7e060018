import dataclasses
import json
import re
import tomllib

import numpy as np
import pytest

from hopping_leg.errors import UsageError
from hopping_leg.identify import result, validation
from hopping_leg.identify.result import as_json, posterior_robots, save_robot, shown_errors
from hopping_leg.io import write_json
from hopping_leg.robot import check_physics, load_robot, load_tree
from tests.identify.fitting import TRUTH, identified, run

CLOSED_LOOP = ("closed_loop_position_rms_rad", "closed_loop_torque_rms_nm")


def test_the_result_says_what_it_was_made_from_how_it_was_judged_and_within_which_intervals():
    tree = as_json(identified())
    assert tree["warning"] == ""
    assert {r["use"] for r in tree["recordings"]} == {"fit", "judge"}
    assert sum(r["rows"] for r in tree["recordings"]) == len(run())
    assert tree["versions"]["mujoco"]
    assert tree["robot_digest"] == identified().robot.digest
    (one,) = tree["search"]["passes"]
    assert one["history"][-1] == one["cost"]
    for part in (tree["validation"], tree["start_validation"]):
        assert {len(part[name]) for name in CLOSED_LOOP} == {2}
        horizons = part["open_loop_position_rms_rad"]
        assert {key: len(pair) for key, pair in horizons.items()} == {"0.2": 2, "0.5": 2, "1.0": 2}
    assert [row["name"] for row in tree["parameters"]] == list(TRUTH)
    for row in tree["parameters"]:
        assert row["bound_low"] <= row["value"] <= row["bound_high"]
        assert row["interval_low"] <= row["value"] <= row["interval_high"]
    assert tree["correlations"]["names"] == list(TRUTH)
    np.testing.assert_allclose(np.diag(tree["correlations"]["matrix"]), 1.0)


def test_intervals_end_where_what_is_possible_does():
    wide = dataclasses.replace(identified().identifiability, half_width=np.full(len(TRUTH), 9.0))
    for row in as_json(dataclasses.replace(identified(), identifiability=wide))["parameters"]:
        assert 0 == row["interval_low"] <= row["value"] <= row["interval_high"] < np.inf


def test_draws_have_the_intervals_quantiles_and_stay_within_what_is_possible():
    found = identified()
    known, (low, high) = found.identifiability, found.passes[-1].parameters.bounds
    low, high = (found.passes[-1].parameters.values(b) for b in (low, high))
    deviation = np.sqrt(np.diag(known.covariance))
    wide = dataclasses.replace(known, covariance=known.covariance * 1e6)  # beyond the bounds
    for one in (known, wide):
        drawn = dataclasses.replace(found, identifiability=one).posterior(20_000, seed=1)
        spread = np.sqrt(np.diag(one.covariance))
        for side, share in ((-1.96, 0.025), (1.96, 0.975)):
            expected = np.clip(known.values + side * spread, low, high)
            error = np.abs(np.quantile(drawn, share, axis=0) - expected)
            np.testing.assert_array_less(error, 0.06 * spread)
        assert ((low <= drawn) & (drawn <= high)).all()
    np.testing.assert_allclose(1.96 * deviation, known.half_width, rtol=1e-4)
    written = as_json(found, posterior=3)["posterior"]
    assert (written["names"], len(written["units"])) == (list(TRUTH), len(TRUTH))
    np.testing.assert_array_equal(written["samples"], found.posterior(3, found.seed))
    for row in found.posterior(20, seed=2):
        check_physics(found.hypothesis.replace(dict(zip(known.names, row, strict=True))).robot, "")


def test_what_does_not_exist_is_null_and_nobody_tells_of_it():
    nothing = dict.fromkeys(CLOSED_LOOP, (np.nan, np.nan))
    found, names = identified(), ("validation", "start_validation")
    known = {when: dataclasses.replace(getattr(found, when), **nothing) for when in names}
    certain = dataclasses.replace(found.identifiability, half_width=np.array([np.inf, 1.0]))
    tree = as_json(dataclasses.replace(found, **known, identifiability=certain))
    assert json.loads(json.dumps(tree, allow_nan=False)) == tree
    assert tree["parameters"][0]["interval_high"] is None
    assert all(tree["validation"][name] == [None, None] for name in CLOSED_LOOP)
    assert [row["error"] for row in tree["quality"]] == [
        f"position, predicted {horizon} s ahead" for horizon in ("0.2", "0.5", "1")
    ]
    mute = dataclasses.replace(found.validation, closed_loop_torque_rms_nm=(np.nan, np.nan))
    rows = shown_errors(dataclasses.replace(found, validation=mute))
    assert [row.count("-") for row in rows] == [0, 2, 0, 0, 0]


@pytest.mark.parametrize(
    ("after", "said"),
    [((0.005, 0.1), r"2\.44 times.*, knee, .*keep that"), ((0.09, 0.04), ""), ((0.07, 0.0002), "")],
)
def test_the_worse_joint_decides_whether_a_fit_is_worse(after, said):
    """A fit that is far better at the hip hides no knee; nobody minds a tenth of a mrad."""
    before = (0.093, 0.041) if after[1] > 1e-3 else (0.093, 0.0001)
    unknown = (np.nan, np.nan)
    judged = [validation.Validation(unknown, unknown, {"0.2": pair}) for pair in (after, before)]
    found = dataclasses.replace(identified(), validation=judged[0], start_validation=judged[1])
    assert re.search(said or "^$", result.warning(found))
    errs = f"0.2 s ahead, rms: hip {1e3 * after[0]:.3g} mrad (93 before), knee {1e3 * after[1]:.3g}"
    assert errs in result.verdict(found)


def test_every_identified_number_says_so_below_its_provenance_and_all_others_stay(tmp_path):
    saved = tmp_path / "mine.toml"
    save_robot(identified(), saved, "legv2")
    text = "".join(line for line in saved.open() if line.startswith("#"))
    for part in ("swing 0.0, 0.0-4.5 s", "seed 0", "mujoco", "least-squares", "closed loop, "):
        assert part in text
    assert "AT A BOUND" not in text
    robot = load_robot(saved)
    assert (robot.name, robot.digest) == ("mine", identified().robot.digest)
    tree, before = load_tree(saved), load_tree("legv2")
    assert tree["hip"]["friction"]["source"].startswith("identified: 95 % ")
    assert "start 0.0412" in tree["hip"]["friction"]["source"]
    for name in TRUTH:
        joint, field = name.split(".")
        before[joint][field] = tree[joint][field]
    assert {**tree, "name": "", "description": ""} == {**before, "name": "", "description": ""}


def found_of(name, unit, value):
    """Return the identification as if its second parameter had been another."""
    found = identified()
    values = np.array([found.identifiability.values[0], value])
    known = dataclasses.replace(found.identifiability, values=values)
    searched = found.passes[-1].parameters
    first = searched.parameters[0]
    pair = (first, dataclasses.replace(first, name=name, unit=unit))
    searched = dataclasses.replace(searched, parameters=pair)
    last = dataclasses.replace(found.passes[-1], parameters=searched)
    return dataclasses.replace(found, identifiability=known, passes=(last,))


def test_what_belongs_to_the_rig_stays_out_of_the_robot_and_a_bound_is_said_first(tmp_path):
    path, found = tmp_path / "mine.toml", found_of("drive.hip.stiffness", "N m/rad", 9.0)
    known = dataclasses.replace(found.identifiability, at_bound=[False, True])
    save_robot(dataclasses.replace(found, identifiability=known), path, "legv2")
    assert "AT A BOUND OF THE SEARCH: drive.hip.stiffness 9 N m/rad." in next(path.open())
    assert "drive" not in tomllib.loads(path.read_text())
    assert "#   drive.hip.stiffness = 9 N m/rad" in path.read_text()


@pytest.mark.parametrize(("delay", "latency"), [(0.003, 0.003), (0.0, 0.0)])
def test_a_delay_that_was_found_is_one_that_training_has(tmp_path, delay, latency):
    path = tmp_path / "mine.toml"
    save_robot(found_of("drive.delay", "s", delay), path, "legv2")
    robot = load_robot(path)
    assert robot.reality.latency.command == latency
    assert robot.reality == robot.reality.in_training
    assert ("reality" in tomllib.loads(path.read_text())) == (delay > 0)


def test_draws_become_legs_whose_delay_is_their_latency_without_the_drives(tmp_path):
    file, tree, robot = tmp_path / "leg.json", as_json(identified(), 3), identified().robot
    tree["posterior"]["names"] = ["drive.delay", "drive.creep"]
    write_json(file, tree)
    legs = posterior_robots(file, robot)
    delays = [delay for delay, _ in tree["posterior"]["samples"]]
    assert [leg.reality.latency.command for leg in legs] == delays
    assert {dataclasses.replace(leg, reality=robot.reality) for leg in legs} == {robot}
    write_json(file, {**tree, "posterior": {"names": [], "samples": []}})
    with pytest.raises(UsageError, match="no whole draws"):
        posterior_robots(file, robot)
