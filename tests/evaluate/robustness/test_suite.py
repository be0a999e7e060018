"""Results are kept, say what they depend on, and repeat."""

import dataclasses
import json

import pytest

from hopping_leg.controllers.registry import load_controller
from hopping_leg.evaluate import Entry
from hopping_leg.evaluate.entries import fingerprint
from hopping_leg.evaluate.figures import draw_robustness
from hopping_leg.evaluate.result_files import ResultCache
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
