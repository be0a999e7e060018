import json
import subprocess
import sys
import time
from pathlib import Path

import pytest

from hopping_leg.cli import evaluate, main
from hopping_leg.cli.reproduce import NOTHING_MEANT
from hopping_leg.controllers.registry import shipped_policies

pytest.importorskip("torch")
from hopping_leg.sim_to_real.transfer import Transfer

NUMBERS = {"rows": [], "methods": [], "comparison": [], "notes": []}


@pytest.fixture
def calls(monkeypatch):
    """Replace transfer and evaluation by notes of what they were asked for."""
    found = {"transfer": [], "evaluate": []}

    def fake_run(transfer, at_once, _afterwards):
        found["transfer"].append((transfer, at_once))
        return NUMBERS

    monkeypatch.setattr(Transfer, "run", fake_run)
    monkeypatch.setattr(evaluate, "run", lambda args, notes: found["evaluate"].append(args))
    return found


def test_it_goes_from_a_twin_to_a_judged_policy(calls, tmp_path, capsys):
    assert main(["reproduce", "--out", str(tmp_path), "--seed", "3"]) == 0
    [(transfer, at_once)] = calls["transfer"]
    assert (transfer.seed, transfer.recipe.schedule.steps, at_once) == (3, 1_200_000, 2)
    assert not transfer.twin.robot.reality.neutral
    [judged] = calls["evaluate"]
    policy, *others = judged.controllers
    assert policy.endswith("identified-seed3/policy.onnx")
    assert others == [*shipped_policies(), "energy-shaping"]
    assert judged.robot.endswith("identified.toml")
    assert judged.out == tmp_path
    assert judged.seed != 3
    assert json.loads((tmp_path / "transfer.json").read_text()) == {**NUMBERS, "notes": []}
    assert "report.html" in capsys.readouterr().out


def test_sizes_have_folders_of_their_own_and_a_twin_of_your_own_plays_the_real_leg(
    calls, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    for words in ([], ["--quick", "--twin", "twin"]):
        assert main(["reproduce", *words]) == 0
    usual, quick = (transfer for transfer, _ in calls["transfer"])
    folders = [transfer.folder.parent for transfer in (usual, quick)]
    assert folders == [Path("runs") / name for name in ("reproduce", "quick")]
    assert (quick.twin.name, quick.twin.believed) == ("twin", "legv2-paper")
    assert calls["evaluate"][1].seeds == 1


@pytest.mark.parametrize(("first", "then"), [([], ["--quick"]), (["--quick"], [])])
def test_a_folder_never_mixes_sizes(calls, tmp_path, refused, first, then):
    words = ["reproduce", "--out", str(tmp_path)]
    assert main([*words, *first]) == 0
    refused([*words, *then], "give another --out")
    assert len(calls["transfer"]) == 1
    assert main([*words, *first]) == 0


@pytest.mark.parametrize("wrong", ["--steps 0", "--jobs 0", "--seed -1", "--twin legv2"])
def test_meaningless_options_are_refused_before_anything_runs(calls, tmp_path, wrong):
    assert main(["reproduce", "--out", str(tmp_path / "new"), *wrong.split()]) == 2
    assert not calls["transfer"]
    assert not Path(tmp_path / "new").exists()


@pytest.mark.slow
def test_a_killed_quick_run_goes_on_and_says_that_its_numbers_mean_nothing(tmp_path):
    command = [sys.executable, "-m", "hopping_leg.cli", "reproduce", "--quick"]
    quiet = subprocess.DEVNULL
    process = subprocess.Popen(command, cwd=tmp_path, stdout=quiet, stderr=quiet)
    folder = tmp_path / "runs" / "quick"
    recordings = folder / "transfer" / "recordings"
    deadline = time.monotonic() + 240
    while len(list(recordings.glob("*.parquet"))) < 2 and time.monotonic() < deadline:
        time.sleep(0.2)
    time.sleep(3)
    process.kill()
    process.wait()
    recorded = {path: path.stat().st_mtime_ns for path in recordings.glob("*.parquet")}
    assert len(recorded) == 2
    assert not (folder / "report.html").exists()
    time.sleep(2)
    again = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=900)
    assert again.returncode == 0, again.stderr
    assert "Report:" in again.stdout
    assert NOTHING_MEANT in again.stdout
    assert {path: path.stat().st_mtime_ns for path in recorded} == recorded
    evaluation = json.loads((folder / "evaluation.json").read_text())
    assert {row["controller"] for row in evaluation["summary"]} >= {"energy-shaping"}
    transfer = json.loads((folder / "transfer.json").read_text())
    assert {row["method"] for row in transfer["trials"]} == {"identified", "cad", "energy-shaping"}
    assert evaluation["notes"][0] == transfer["notes"][0] == NOTHING_MEANT
    assert NOTHING_MEANT in (folder / "report.html").read_text()
