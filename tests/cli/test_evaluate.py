import json

import pytest

from hopping_leg.cli import main
from hopping_leg.cli.evaluate import Evaluate
from hopping_leg.controllers.registry import load_policy
from hopping_leg.evaluate.runner import setup_conditions
from hopping_leg.robot import DEFAULT_ROBOT
from hopping_leg.trace import Trace


def test_one_folder_receives_numbers_report_and_traces(spring, tmp_path, capsys):
    out = tmp_path / "run"
    words = ["evaluate", "spring", "--commands", "0.3", "--seeds", "1", "--no-video"]
    assert main([*words, "--threads", "1", "--out", str(out)]) == 0
    data = json.loads((out / "evaluation.json").read_text())
    assert [row["command_m"] for row in data["summary"]] == [0.3]
    assert data["command"].startswith("hop evaluate spring --commands 0.3 --seeds 1")
    assert data["secondary"]["conditions"]["floor"] == "stiff"
    assert b"hop evaluate spring --commands 0.3 --seeds 1" in (out / "report.html").read_bytes()
    traces = sorted((out / "traces").iterdir())
    assert [path.name for path in traces] == [
        "spring-fixed-0.300-0.parquet",
        "spring-ladder-0.300-0.parquet",
    ]
    assert Trace.load(traces[0]).header["controller"] == "spring"
    assert "spring" in capsys.readouterr().out
    figures = tmp_path / "figures"
    words = ["report", "--out", str(figures)]
    assert main([*words, "--format", "png", *map(str, traces)]) == 0
    assert {"heights.png", "ladder.png"} <= {path.name for path in figures.iterdir()}


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--commands", "0.5"], "trained for 0.29 to 0.31 m"),
        (["--commands", "high"], "--commands"),
        (["--seed", "-1"], "--seed is -1"),
        (["--threads", "-1"], "'threads' is -1"),
        (["--timestep", "0.003"], "does not divide"),
    ],
)
def test_bad_input_is_one_sentence(spring, refused, words, sentence):
    refused(["evaluate", "spring", *words], sentence)


def test_robustness_leaves_numbers_and_figure(spring, tmp_path, capsys):
    out, file = tmp_path / "kept", tmp_path / "robustness.json"
    words = ["evaluate", "spring", "--suite", "robustness", "--commands", "0.3", "--seeds", "2"]
    words += ["--axes", "pushes", "--threads", "1", "--out", str(out), "--json", str(file)]
    assert main(words) == 0
    data = json.loads(file.read_text())
    assert [row["axis"] for row in data["scores"]] == ["pushes", "overall"]
    assert all(0 <= row["low"] <= row["score"] <= row["high"] <= 1 for row in data["scores"])
    assert data["command"].startswith("hop evaluate spring")
    assert "--axes pushes" in data["command"]
    assert (out / "robustness.svg").read_bytes().startswith(b"<?xml")
    assert "overall" in capsys.readouterr().out


@pytest.mark.parametrize("on", [True, False])
def test_soft_limits_may_be_left_out(on):
    _, setup = Evaluate(("energy-shaping",), soft_limits=on).load()
    assert (setup.soft_limits is not None) == on
    assert (setup_conditions(setup)["soft_limits"] is not None) == on


@pytest.mark.parametrize(
    ("controllers", "given", "robot"),
    [
        (("energy-shaping",), None, DEFAULT_ROBOT),
        (("energy-shaping", "paper"), None, load_policy("paper").card.robot),
        (("paper",), "legv2", "legv2"),
    ],
)
def test_the_leg_is_that_of_the_first_policy_unless_another_is_named(controllers, given, robot):
    _, setup = Evaluate(controllers, robot=given).load()
    assert setup.robot.name == robot
