"""The tables say what came out."""

import numpy as np
import pytest

from studies.sim_to_real.tables import _ERROR, compare, tabulate


def trials(errors, commands=(0.25, 0.35), **more):
    """Return trial rows from errors[method][twin][command]."""
    return [
        {
            "method": method, "twin": twin, "seed": 0, "command_m": command,
            "median_error_m": float(error), "median_abs_error_m": abs(float(error)),
            "std_m": 0.001, "hops": 10, "skipped_hops": 1, "body_contacts": 0,
            "missed_runs": 0, "motionless": False, **more,
        }
        for method, twins in errors.items()
        for twin, of_commands in twins.items()
        for command, error in zip(commands, of_commands, strict=True)
    ]  # fmt: skip


ERRORS = {
    "identified": {"a": (0.01, -0.02), "b": (0.02, 0.03), "c": (0.03, 0.04)},
    "cad": {"a": (0.03, -0.06), "b": (0.06, 0.09), "c": (-0.09, -0.12)},
}


def rows_of(trials):
    return tabulate({"identified": "from recordings"}, trials)["rows"]


def test_rows_are_medians_over_twins_with_intervals_around_them_if_there_are_twenty():
    row = rows_of([r for r in trials(ERRORS) if r["method"] == "identified"])[1]
    assert row["command_m"] == 0.35
    assert row["median_abs_error_m"] == pytest.approx(0.03)
    assert row["median_error_m"] == pytest.approx(0.03)
    assert row["worst_abs_error_m"] == pytest.approx(0.04)
    assert np.isnan(row["median_abs_error_low_m"])
    assert (row["hops"], row["skipped_hops"], row["policies"]) == (30, 3, 3)
    errors = {"identified": {f"twin-{k}": (0.001 * (k + 1), 0.02) for k in range(20)}}
    row = rows_of(trials(errors))[0]
    assert 0.004 < row["median_abs_error_low_m"] < 0.0105 < row["median_abs_error_high_m"] < 0.017


def test_the_ratio_meets_the_same_twins():
    factors = {"identified": (0.001, 0.002), "cad": (0.003, -0.006)}
    errors = {
        method: {f"twin-{k}": ((k + 1) * low, (k + 1) * high) for k in range(20)}
        for method, (low, high) in factors.items()
    }
    found = compare("identified", "cad", trials(errors))
    ratios = [found[name] for name in ("ratio", "ratio_low", "ratio_high")]
    assert ratios == pytest.approx([3.0] * 3)


def test_intervals_resample_the_seeds_of_trainings_of_twins_that_are_alike():
    rows = trials({name: {f"twin-{k}": (0.002, 0.002) for k in range(20)} for name in ERRORS})
    rows = [row | {"seed": n, _ERROR: 2e-3 * (1 + n)} for n in range(3) for row in rows]
    found = compare("identified", "cad", rows)
    assert found["ratio_low"] < 0.7 < found["ratio"] < 1.4 < found["ratio_high"]
    row = rows_of([row for row in rows if row["method"] == "identified"])[0]
    assert row["median_abs_error_low_m"] < row[_ERROR] < row["median_abs_error_high_m"]


def test_order_is_of_the_apexes_and_a_leg_that_stands_has_none():
    rows = trials({"identified": {"a": (0.0, -0.099), "b": (0.06, -0.05), "c": (0.0, 0.0)}})
    assert tabulate({"identified": ""}, rows)["methods"][0]["ordered"] == 2
    for row in rows[-2:]:
        row["motionless"] = True
    assert tabulate({"identified": ""}, rows)["methods"][0]["ordered"] == 1
