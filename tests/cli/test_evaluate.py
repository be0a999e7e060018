import dataclasses
import json

import pytest

from hopping_leg.cli import main
from hopping_leg.cli.evaluate import Evaluate, load
from hopping_leg.controllers.registry import ROBOT_FILE, load_policy, robot_of
from hopping_leg.evaluate.runner import setup_conditions
from hopping_leg.robot import DEFAULT_ROBOT, load_robot
from hopping_leg.trace import Trace
from tests.doc_pages import ROOT


def test_one_folder_receives_numbers_report_and_traces(spring, tmp_path, capsys):
    out = tmp_path / "run"
    words = ["evaluate", "spring", "--commands", "0.3", "--seeds", "1", "--threads", "1"]
    assert main([*words, "--json", str(tmp_path / "own.json")]) == 0
    assert json.loads((tmp_path / "own.json").read_text())["secondary"] is None, "the same floor"
    assert main([*words, "--robot", "legv2-paper", "--out", str(out)]) == 0
    data = json.loads((out / "evaluation.json").read_text())
    assert [row["command_m"] for row in data["summary"]] == [0.3]
    assert data["command"].startswith("hop evaluate spring --commands 0.3 --seeds 1")
    assert data["secondary"]["conditions"]["floor"] == "stiff"
    assert b"hop evaluate spring --commands 0.3 --seeds 1" in (out / "report.html").read_bytes()
    traces = sorted((out / "traces").iterdir())
    assert [p.name for p in traces] == [f"spring-{k}-0.300-0.parquet" for k in ("fixed", "ladder")]
    assert Trace.load(traces[0]).header["controller"] == "spring"
    assert "spring" in capsys.readouterr().out
    figures = tmp_path / "figures"
    words = ["report", "--out", str(figures)]
    assert main([*words, "--format", "png", *map(str, traces)]) == 0
    assert {"heights.png", "ladder.png"} <= {path.name for path in figures.iterdir()}


def test_robustness_leaves_numbers_and_figure(spring, tmp_path, capsys):
    out, file = tmp_path / "kept", tmp_path / "robustness.json"
    words = ["evaluate", "spring", "--suite", "robustness", "--commands", "0.3", "--seeds", "2"]
    words += ["--axes", "pushes", "--threads", "1", "--out", str(out), "--json", str(file)]
    assert main(words) == 0
    data = json.loads(file.read_text())
    assert [row["axis"] for row in data["scores"]] == ["pushes", "overall"]
    assert all(0 <= row["low"] <= row["score"] <= row["high"] <= 1 for row in data["scores"])
    assert data["command"].startswith("hop evaluate spring")
    assert (out / "robustness.svg").read_bytes().startswith(b"<?xml")
    assert "overall" in capsys.readouterr().out


@pytest.mark.parametrize("on", [True, False])
def test_soft_limits_may_be_left_out(on):
    _, setup = load(Evaluate(("energy-shaping",), soft_limits=on))
    assert (setup.soft_limits is not None) == on
    assert (setup_conditions(setup)["soft_limits"] is not None) == on


def test_a_policy_is_judged_on_the_robot_that_lies_beside_it(tmp_path, monkeypatch, capsys):
    onnx_export = pytest.importorskip("hopping_leg.rl.onnx_export")
    from hopping_leg.rl.run_folder import write_robot

    monkeypatch.setattr("hopping_leg.evaluate.trials.FIXED_SECONDS", 3.0)
    monkeypatch.setattr("hopping_leg.evaluate.trials.STEP_SECONDS", 2.0)
    monkeypatch.chdir(tmp_path)
    robot, policy = load_robot(ROOT / "examples/my_leg.toml"), load_policy("fast")
    folder = tmp_path / "runs" / "my run"
    folder.mkdir(parents=True)
    file, beside = folder / "policy.onnx", str(folder / ROBOT_FILE)
    card = dataclasses.replace(policy.card, robot=robot.name, robot_digest=robot.digest)
    file.write_bytes(onnx_export.with_card(policy.content, card))
    write_robot(folder, robot)
    assert load_robot(beside) == robot
    for named in (str(file), f"mine={file}"):
        assert robot_of([named]) == beside
    short = ["--seeds", "1", "--commands", "0.3", "--floor", "soft"]
    assert main(["evaluate", str(file), "--robot", "legv2", *short]) == 0
    said = capsys.readouterr().out
    assert said.index("was trained on robot 'my-leg'") < said.index("soft floor")
    (folder / ROBOT_FILE).rename(leg := folder / "leg.toml")
    assert robot_of([str(file)]) == DEFAULT_ROBOT
    file.with_suffix(".toml").write_text('robot = "leg.toml"')
    assert robot_of([str(file)]) == str(leg)
