import json
import subprocess
import sys
import time
from pathlib import Path

import pytest

from hopping_leg.cli import evaluate, main

pytest.importorskip("torch")
from hopping_leg.evaluate.transfer import run as transfer_run
from hopping_leg.learn.fast import FastRecipe

NUMBERS = {"rows": [], "methods": [], "comparison": []}


@pytest.fixture
def calls(monkeypatch):
    """Replace study and evaluation by notes of what they were asked for."""
    found = {"transfer": [], "evaluate": []}

    def fake_transfer(study, at_once):
        found["transfer"].append((study, at_once))
        return NUMBERS

    monkeypatch.setattr(transfer_run, "transfer", fake_transfer)
    monkeypatch.setattr(evaluate, "run", found["evaluate"].append)
    return found


def test_it_goes_from_a_twin_to_a_judged_policy(calls, tmp_path, capsys):
    assert main(["reproduce", "--out", str(tmp_path), "--seed", "3"]) == 0
    [(study, at_once)] = calls["transfer"]
    assert [method.name for method in study.methods] == ["identified", "cad"]
    assert (study.seeds, len(study.twins), at_once) == ((3,), 1, 2)
    assert not study.twins[0].robot.reality.neutral
    [judged] = calls["evaluate"]
    policy, *others = judged.controllers
    assert policy.endswith("identified-seed3/policy.onnx")
    assert others == ["fast", "paper", "precise", "energy-shaping"]
    assert judged.robot.endswith("identified.toml")
    assert judged.out == tmp_path
    assert judged.seed != 3
    assert json.loads((tmp_path / "transfer.json").read_text()) == NUMBERS
    assert "report.html" in capsys.readouterr().out


def test_the_paper_sizes_have_every_twin_method_and_second(calls, tmp_path):
    assert main(["reproduce", "--full", "--out", str(tmp_path)]) == 0
    [(study, _)] = calls["transfer"]
    assert (study.seconds, len(study.twins), study.steps) == (240.0, 5, FastRecipe.steps)
    names = {method.name for method in study.methods}
    assert names >= {"identified", "cad", "table-1", "randomised", "two-pass", "one-pass"}


def test_a_twin_of_your_own_plays_the_real_leg(calls, tmp_path):
    assert main(["reproduce", "--quick", "--twin", "twin", "--out", str(tmp_path)]) == 0
    [(study, _)] = calls["transfer"]
    assert [(twin.name, twin.believed) for twin in study.twins] == [("twin", "legv2-paper")]
    assert calls["evaluate"][0].seeds == 1


@pytest.mark.parametrize(
    "wrong",
    [
        ["--steps", "0"],
        ["--jobs", "0"],
        ["--seed", "-1"],
        ["--quick", "--full"],
        ["--twin", "legv2"],
    ],
)
def test_meaningless_options_are_refused_before_anything_runs(calls, tmp_path, wrong):
    assert main(["reproduce", "--out", str(tmp_path / "new"), *wrong]) == 2
    assert not calls["transfer"]
    assert not Path(tmp_path / "new").exists()


@pytest.mark.slow
def test_a_killed_run_goes_on_when_called_again(tmp_path):
    command = [sys.executable, "-m", "hopping_leg.cli", "reproduce", "--quick"]
    command += ["--out", str(tmp_path)]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    recordings = tmp_path / "transfer" / "recordings"
    deadline = time.monotonic() + 240
    while len(list(recordings.glob("*.parquet"))) < 2 and time.monotonic() < deadline:
        time.sleep(0.2)
    time.sleep(3)
    process.kill()
    process.wait()
    recorded = {path: path.stat().st_mtime_ns for path in recordings.glob("*.parquet")}
    assert len(recorded) == 2
    assert not (tmp_path / "report.html").exists()
    time.sleep(2)
    again = subprocess.run(command, capture_output=True, text=True, timeout=900)
    assert again.returncode == 0, again.stderr
    assert "Report:" in again.stdout
    assert {path: path.stat().st_mtime_ns for path in recorded} == recorded
    summary = json.loads((tmp_path / "evaluation.json").read_text())["summary"]
    assert {row["controller"] for row in summary} >= {"energy-shaping"}
    trials = json.loads((tmp_path / "transfer.json").read_text())["trials"]
    assert {row["method"] for row in trials} == {"identified", "cad"}
    assert (tmp_path / "report.html").stat().st_size > 10_000
