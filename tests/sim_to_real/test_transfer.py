"""The tables say what came out."""

import dataclasses
import json

import numpy as np
import pytest

from hopping_leg.evaluate import motor_load
from hopping_leg.sim_to_real import transfer
from hopping_leg.sim_to_real.methods import METHODS
from hopping_leg.sim_to_real.transfer import compare
from tests.sim_to_real.studies import study

LOAD = dataclasses.asdict(motor_load.unknown())


def trials(errors, commands=(0.25, 0.35), **more):
    """Return trial rows from errors[method][twin][command]."""
    return [
        {
            "method": method, "twin": twin, "seed": 0, "command_m": command,
            "median_error_m": float(error), "median_abs_error_m": abs(float(error)),
            "std_m": 0.001, "hops": 10, "skipped_hops": 1, "body_contacts": 0,
            "missed_runs": 0, "motionless": False, **LOAD, **more,
        }
        for method, twins in errors.items()
        for twin, of_commands in twins.items()
        for command, error in zip(commands, of_commands, strict=True)
    ]  # fmt: skip


ERRORS = {
    "identified": {"a": (0.01, -0.02), "b": (0.02, 0.03), "c": (0.03, 0.04)},
    "cad": {"a": (0.03, -0.06), "b": (0.06, 0.09), "c": (-0.09, -0.12)},
}


def test_rows_are_medians_over_twins_with_intervals_around_them():
    rows = [r for r in trials(ERRORS) if r["method"] == "identified" and r["command_m"] == 0.35]
    row = transfer._pooled(METHODS["identified"], rows)
    assert row["median_abs_error_m"] == pytest.approx(0.03)
    assert row["median_error_m"] == pytest.approx(0.03)
    assert row["worst_abs_error_m"] == pytest.approx(0.04)
    assert np.isnan(row["median_abs_error_low_m"]), "three twins are too few for an interval"
    assert (row["hops"], row["skipped_hops"], row["policies"]) == (30, 3, 3)


def test_twenty_twins_have_intervals():
    errors = {"identified": {f"twin-{k}": (0.001 * (k + 1), 0.02) for k in range(20)}}
    rows = [r for r in trials(errors) if r["command_m"] == 0.25]
    row = transfer._pooled(METHODS["identified"], rows)
    assert 0.004 < row["median_abs_error_low_m"] < 0.0105 < row["median_abs_error_high_m"] < 0.017


def test_the_ratio_meets_the_same_twins():
    errors = {"identified": {}, "cad": {}}
    for k in range(20):
        errors["identified"][f"twin-{k}"] = (0.001 * (k + 1), 0.002 * (k + 1))
        errors["cad"][f"twin-{k}"] = (0.003 * (k + 1), -0.006 * (k + 1))
    found = compare("identified", "cad", trials(errors), 0)
    assert found["ratio"] == pytest.approx(3.0)
    assert found["ratio_low"] == pytest.approx(3.0)
    assert found["ratio_high"] == pytest.approx(3.0)
    assert found["least_ratio_of_a_command"] == pytest.approx(3.0)


def test_order_is_of_the_apexes_and_a_leg_that_stands_has_none(tmp_path):
    one = study(tmp_path, ("identified",), commands=(0.25, 0.35))
    method = one.methods[0]
    rows = trials({"identified": {"a": (0.0, -0.099), "b": (0.06, -0.05), "c": (0.0, 0.0)}})
    assert transfer._whole(method, rows, one)["ordered"] == 2
    for row in rows[-2:]:
        row["motionless"] = True
    assert transfer._whole(method, rows, one)["ordered"] == 1


def test_of_several_trainings_the_better_one_is_chosen_in_its_own_simulation_alone(tmp_path):
    one = study(tmp_path, seeds=(0, 1), commands=(0.25, 0.35))
    good, bad = (0.01, 0.01), (0.1, 0.1)
    rows = []
    for method in one.methods:
        for number, twin in enumerate(one.twins):
            best = number if method.of_twin else 1
            for seed in one.seeds:
                folder = one.training(twin, method, seed)
                folder.mkdir(parents=True, exist_ok=True)
                selected = {"selected": {"score_m": 0.002 if seed == best else 0.3}}
                (folder / "result.json").write_text(json.dumps(selected))
                errors = {method.name: {twin.name: bad if seed == best else good}}
                rows += [{**row, "seed": seed} for row in trials(errors)]
    (found,) = transfer._best_in_own_simulation(rows, one).values()
    assert [row["policies"] for row in found["methods"]] == [2, 2]
    assert [row["worst_abs_error_m"] for row in found["methods"]] == [0.1, 0.1]
    assert found["comparison"][0]["ratio"] == pytest.approx(1.0)
    assert transfer._best_in_own_simulation(rows, study(tmp_path)) == {}
