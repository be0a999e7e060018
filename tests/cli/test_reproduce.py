import json
import subprocess
import sys
import time
from pathlib import Path

import pytest

from hopping_leg.cli import evaluate, main

pytest.importorskip("torch")
from hopping_leg.learn import run_folder, train


@pytest.fixture
def calls(monkeypatch):
    """Replace training and evaluation by notes of what they were asked for."""
    found = {"train": [], "evaluate": []}

    def fake_train(recipe, robot, seed, out, *, resume, minutes, threads):
        folder = run_folder.RunFolder(out, recipe, robot, seed, minutes)
        folder.begin(resume=resume)
        folder.policy.write_bytes(b"")
        found["train"].append((recipe.name, robot.name, seed, minutes, resume))
        return train.Trained(folder.policy, out, minutes, 0, [])

    monkeypatch.setattr(train, "train", fake_train)
    monkeypatch.setattr(evaluate, "run", found["evaluate"].append)
    return found


def test_it_trains_from_scratch_and_judges_beside_energy_shaping(calls, tmp_path, capsys):
    assert main(["reproduce", "--out", str(tmp_path), "--seed", "3", "--minutes", "4"]) == 0
    assert calls["train"] == [("fast", "legv2-paper", 3, 4.0, True)]
    [judged] = calls["evaluate"]
    assert judged.controllers[0] == str(tmp_path / "training" / "policy.onnx")
    assert judged.controllers[-1] == "energy-shaping"
    assert judged.out == tmp_path
    assert judged.seed != 3
    assert "report.html" in capsys.readouterr().out


def test_a_second_call_keeps_the_finished_training(calls, tmp_path):
    for _ in range(2):
        assert main(["reproduce", "--quick", "--out", str(tmp_path)]) == 0
    assert len(calls["train"]) == 1
    assert len(calls["evaluate"]) == 2
    assert calls["evaluate"][0].seeds == 1


def test_another_training_in_the_folder_is_not_mistaken_for_this_one(calls, tmp_path, capsys):
    assert main(["reproduce", "--out", str(tmp_path)]) == 0
    assert main(["reproduce", "--out", str(tmp_path), "--seed", "1"]) == 2
    assert "another seed" in capsys.readouterr().err


@pytest.mark.parametrize("wrong", [["--minutes", "nan"], ["--threads", "0"], ["--seed", "-1"]])
def test_meaningless_options_are_refused_before_anything_runs(calls, tmp_path, wrong):
    assert main(["reproduce", "--out", str(tmp_path / "new"), *wrong]) == 2
    assert not calls["train"]
    assert not Path(tmp_path / "new").exists()


@pytest.mark.slow
def test_a_killed_run_goes_on_when_called_again(tmp_path):
    command = [sys.executable, "-m", "hopping_leg.cli", "reproduce", "--quick"]
    command += ["--minutes", "0.3", "--out", str(tmp_path)]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    config = tmp_path / "training" / "config.json"
    deadline = time.monotonic() + 120
    while not config.exists() and time.monotonic() < deadline:
        time.sleep(0.2)
    time.sleep(3)
    process.kill()
    process.wait()
    assert config.exists()
    assert not (tmp_path / "report.html").exists()
    again = subprocess.run(command, capture_output=True, text=True, timeout=600)
    assert again.returncode == 0, again.stderr
    assert "Report:" in again.stdout
    summary = json.loads((tmp_path / "evaluation.json").read_text())["summary"]
    assert {row["controller"] for row in summary} >= {"energy-shaping"}
    assert (tmp_path / "report.html").stat().st_size > 10_000
