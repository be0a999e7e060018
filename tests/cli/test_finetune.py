"""`hop finetune` on the command line."""

import json

import numpy as np
import pytest

from hopping_leg.cli import main
from hopping_leg.cli.finetune import guard_of, line
from hopping_leg.controllers.registry import robot_of
from hopping_leg.robot import load_robot


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["fast"], "either --on"),
        (["fast", "--on", "twin", "--transport", "x"], "either --on"),
        (["fast", "--on", "twin", "--seed", "-1"], "--seed"),
        (["fast", "--on", "twin", "--robot", "twin"], "believe"),
        (["fast", "--on", "twin", "--commands", "0.3"], "at least two"),
        (["fast", "--on", "twin", "--commands", "0.25,0.9"], "0.9 m"),
        (["fast", "--on", "twin", "--minutes", "0"], "minutes"),
        (["fast", "--on", "twin", "--trial-seconds", "600"], "trial of 600"),
        (["fast", "--on", "nobody"], "nobody"),
        (["energy-shaping", "--on", "twin"], "energy-shaping"),
    ],
)
def test_what_has_no_meaning_is_refused_in_a_sentence(words, sentence, refused, tmp_path):
    refused(["finetune", *words, "--out", tmp_path / "run"], sentence)
    assert not (tmp_path / "run").exists()


def test_the_guard_is_the_supervisors():
    robot = load_robot("legv2-paper")
    guard = guard_of(robot, 200.0)
    assert (guard.lower == robot.of_joints("stop_lower")).all()
    rest, towards = np.zeros(2), np.array([0.0, -20.0])
    near = robot.of_joints("stop_lower") + 0.01
    assert not guard.complaint(near, rest)
    assert "left its range" in guard.complaint(near, towards)
    assert (guard.speed > robot.of_joints("no_load_speed")).all()


def test_a_trials_line_says_what_happened():
    row = {"minutes": 1.0, "error_m": 0.02, "true_error_m": 0.018, "hops": 9,
           "complaint": "A joint left its range.", "rolled_back": True}  # fmt: skip
    said = line(row)
    assert "20.0 mm" in said
    assert "18.0 mm" in said
    assert said.endswith("A joint left its range. Rolled back to the best.")


@pytest.mark.slow
def test_a_run_leaves_policy_card_and_numbers(tmp_path, monkeypatch, capsys):
    from hopping_leg.rl.finetune import apex_estimate

    few = apex_estimate.ContactConfig(num_envs=4, seconds=3.0, steps=50, hidden=(8,))
    prepare = apex_estimate.prepare
    monkeypatch.setattr(apex_estimate, "prepare", lambda p, r, _, to: prepare(p, r, few, to))
    out, numbers = tmp_path / "run", tmp_path / "finetune.json"
    words = ["finetune", "fast", "--on", "twin", "--minutes", "0.4"]
    words += ["--trial-seconds", "10", "--out", str(out), "--json", str(numbers)]
    assert main(words) == 0
    result = json.loads(numbers.read_text())
    assert result["policy"] == "fast"
    assert len(result["trials"]) == 2
    assert result["trials"][1]["shifts_m"] != [0.0] * 3
    said = capsys.readouterr().out
    assert "used up" in said
    assert said.endswith(f"Next:\n  hop evaluate {out / 'policy.onnx'}\n")
    assert robot_of([str(out / "policy.onnx")]) == "legv2-identified"
    assert "fast" in (out / "model_card.md").read_text()
    assert main(["policies", "show", str(out / "policy.onnx")]) == 0
    assert main([*words, "--resume"]) == 2
