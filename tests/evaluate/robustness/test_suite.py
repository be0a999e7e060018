"""Results are kept, say what they depend on, and repeat."""

import dataclasses
import json

import pytest

from hopping_leg.controllers.registry import load_controller
from hopping_leg.evaluate import Entry
from hopping_leg.evaluate.entries import fingerprint
from hopping_leg.evaluate.figures import draw_robustness
from hopping_leg.evaluate.result import ResultCache
from hopping_leg.evaluate.robustness.outcome import Outcome, level_rows, score_rows, share
from hopping_leg.evaluate.robustness.suite import make_suite, run_suite
from hopping_leg.figure_style import to_svg

AXES = ("links", "pushes")


@pytest.fixture
def tiny(setup):
    return make_suite(setup, axes=AXES, commands=[0.28, 0.32], repeats=1, seconds=2.5)


def test_a_suite_repeats_keeps_its_results_and_names_its_rows(tiny, spring, tmp_path):
    begun, progress = [], []
    judged = [Entry("my spring", spring)]
    first = run_suite(
        judged,
        tiny,
        ResultCache(tmp_path, begun.append),
        lambda label, share: progress.append(share),
    )
    assert begun == [f"my spring: {axis}" for axis in ("nominal", *AXES)]
    assert progress == sorted(progress)
    assert progress[-1] == 1
    again = run_suite(judged, tiny, ResultCache(tmp_path, begun.append))
    assert len(begun) == 3
    elsewhere = run_suite(judged, tiny, ResultCache(tmp_path / "elsewhere"))
    assert json.dumps(first) == json.dumps(again) == json.dumps(elsewhere)
    other = dataclasses.replace(tiny, seed=7, axes=("pushes",))
    run_suite(judged, other, ResultCache(tmp_path, begun.append))
    assert len(begun) == 5
    svg = to_svg(draw_robustness(first))
    assert svg == to_svg(draw_robustness(first))
    assert all(axis.encode() in svg for axis in AXES) or b"<path" in svg
    scores = {row["axis"]: row for row in first["scores"]}
    assert list(scores) == ["links", "pushes", "overall"]
    assert all({"controller", "score", "low", "high"} <= row.keys() for row in scores.values())
    assert [axis["name"] for axis in first["axes"]] == ["links", "pushes"]
    assert {row["axis"] for row in first["levels"]} == {"nominal", *AXES}
    assert first["conditions"]["seed"] == 1000
    json.dumps(first, allow_nan=False)


def test_controllers_are_told_apart_by_what_they_do(robot, spring):
    names = ("energy-shaping", "energy-shaping-literal", "fast", "paper", "precise")
    prints = [fingerprint(load_controller(name, robot)) for name in names]
    prints.append(fingerprint(spring))
    assert len(set(prints)) == len(prints)
    assert fingerprint(load_controller("energy-shaping", robot)) == prints[0]


def outcome(level, error=0.0, skipped=0, contacts=0, repeat=0, missed=False):
    return Outcome(level, 0.3, repeat, error, missed, skipped, contacts)


def trials(level, *, success, count=4, repeat=0):
    return [outcome(level, 0.0 if success else 0.1, repeat=repeat)] * count


def test_success_needs_every_hop_and_the_right_height():
    assert outcome(1, 0.02).success
    assert outcome(1, -0.02).success
    assert not outcome(1, 0.0201).success
    assert not outcome(1, 0.0, skipped=1).success
    assert not outcome(1, 0.0, missed=True).success


def test_the_share_counts_every_axis_and_level_alike():
    many, few = trials(0.1, success=True, count=30), trials(0.2, success=False, count=2)
    assert share([[*many, *few]], 0)[0] == pytest.approx(0.5)
    more = trials(0.3, success=False)
    assert share([[*many, *few, *more], many], 0)[0] == pytest.approx((1 / 3 + 1) / 2)


def test_the_interval_is_over_realisations_not_over_trials():
    def of(wins):
        return [one for r, win in enumerate(wins) for one in trials(0.1, success=win, repeat=r)]

    score, low, high = share([of([True, False, True])], 1)
    assert score == pytest.approx(2 / 3)
    assert share([of([True, False, True])], 1) == (score, low, high)
    more = [one for one in of([True, False, True]) for _ in range(10)]
    assert share([more], 1) == (score, low, high), "more trials of a realisation tell no more"
    assert high - low > 0.5
    many = share([of([True, False, True] * 20)], 1)
    assert many[2] - many[1] < 0.3
    _, low, high = share([of([True] * 3)], 0)
    assert low < 0.75 < high == 1, "three that agree are no certainty"
    good = [trials(0.1, success=True, repeat=r) for r in range(20)]
    bad = [trials(0.2, success=False, repeat=r) for r in range(20)]
    steady = [one for group in (*good, *bad) for one in group]
    score, low, high = share([steady], 0)
    assert score == 0.5, "levels are chosen, not drawn: their difference is no scatter"
    assert high - low < 0.2


def test_rows_tell_levels_axes_and_the_mean():
    good = [outcome(0.1), outcome(0.1, 0.01)]
    bad = [outcome(0.2, -0.05, contacts=3), outcome(0.2, -0.09, skipped=4, missed=True)]
    levels = level_rows("mine", "delay", [*bad, *good])
    assert [row["level"] for row in levels] == [0.1, 0.2]
    assert [row["success"] for row in levels] == [1.0, 0.0]
    assert levels[0]["median_abs_error_m"] == pytest.approx(0.005)
    assert levels[1]["median_abs_error_m"] == pytest.approx(0.07)
    assert [row["missed"] for row in levels] == [0, 1]
    assert (levels[1]["skipped_hops"], levels[1]["body_contacts"]) == (4, 3)
    rows = score_rows("mine", {"delay": [*good, *bad], "links": good}, 0)
    assert [(row["axis"], row["score"], row["trials"]) for row in rows] == [
        ("delay", 0.5, 4),
        ("links", 1.0, 2),
        ("overall", 0.75, 6),
    ]
