"""Intervals over drawn legs: none where legs are alike, wider for wider draws, true in 9 of 10."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from hopping_leg.cli.evaluate import Evaluate, load
from hopping_leg.errors import UsageError
from hopping_leg.evaluate import evaluate
from hopping_leg.evaluate.metrics import measure
from hopping_leg.evaluate.prediction import compare, observe
from hopping_leg.io import replace_at, write_json

JUDGED, NOISY = load(Evaluate(("fast",)))
_, CLEAN = load(Evaluate(("fast",), noise=False))
ROBOT = NOISY.robot


@pytest.fixture(autouse=True)
def short(monkeypatch):
    monkeypatch.setattr("hopping_leg.evaluate.trials.FIXED_SECONDS", 5.0)


def hop(spread, count, draws=0, setup=NOISY, commands=(0.25, 0.3), **options):
    """Evaluate a policy on legs drawn about its robot; none is the robot itself."""
    legs = []
    for mass, gain in 1 + spread * np.random.default_rng(draws).normal(size=(count, 2)):
        leg = replace_at(ROBOT, "base.mass", ROBOT.base.mass * mass)
        legs.append(replace_at(leg, "knee.torque_gain", ROBOT.knee.torque_gain * gain))
    return evaluate(JUDGED, setup, commands=commands, kinds=("fixed",), robots=legs, **options)


def test_legs_without_a_spread_do_what_the_robot_itself_does():
    drawn, own = hop(0.0, 3), hop(0.0, 0, repeats=3)
    assert drawn.evaluation.summary == own.evaluation.summary
    apexes = [p.mean for p in drawn.evaluation.predictions if p.quantity == "apex_m"]
    behind = [np.mean(one["apexes_m"]) for one in own.evaluation.distributions]
    np.testing.assert_allclose(apexes, behind, atol=1e-5)
    for (window,) in (measure(run.trace) for run in own.runs):
        counted = len(window.apex) / window.settled
        assert observe(window)["hop_rate_hz"] == pytest.approx(counted, abs=1 / window.settled)


def test_intervals_of_a_wider_posterior_hold_those_of_a_narrower():
    narrow, wide = (hop(s, 12, setup=CLEAN).evaluation.predictions for s in (0.01, 0.05))
    for one, other in zip(narrow, wide, strict=True):
        if one.quantity in ("median_apex_m", "knee_p99_torque_nm", "mean_power_w"):
            assert other.low < one.low < one.high < other.high, one.quantity


def test_nine_of_ten_later_runs_are_covered_and_one_that_differs_is_told(tmp_path):
    file = tmp_path / "prediction.json"
    write_json(file, hop(0.03, 40).evaluation.to_json())
    runs = hop(0.03, 40, draws=1, seed=7).runs
    rows = [p for run in runs for p in compare(file, [run])[0] if "skip" not in p.quantity]
    assert len(rows) == 40 * 2 * 9
    assert 0.85 < np.mean([p.inside_share for p in rows]) < 0.95
    assert 0.8 < np.mean([p.holds for p in rows if p.quantity == "median_apex_m"]) < 1
    trace = runs[0].trace
    high = trace.table.with_columns(pl.col("height_m") + 0.05)
    strange = replace(
        trace, table=high, header=trace.header | {"controller": "a", "robot_digest": "b"}
    )
    *warnings, verdict = compare(file, [replace(runs[0], trace=strange)])[1]
    assert [warning.split()[1] for warning in warnings] == ["controller", "robot_digest"]
    assert "is not within what was predicted: median_apex_m" in verdict
    assert "at 0 of 1 commands, and 0% of" in verdict
    with pytest.raises(UsageError, match="No trace hops for 3 s"):
        compare(file, hop(0.0, 1, commands=[0.28]).runs)
