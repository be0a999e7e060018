import errno
import json
import os

import pytest

from hopping_leg import cli
from hopping_leg.errors import TraceError, UsageError
from hopping_leg.locks import hold_folder
from hopping_leg.rl import checkpoint, recipes
from tests.rl.learners import TINY, try_briefly


@pytest.fixture
def tiny(monkeypatch):
    recipe = TINY.replace(name="tiny", steps=64, eval_every=32, learning_starts=32)
    try_briefly(monkeypatch)
    monkeypatch.setitem(recipes.RECIPES, "tiny", recipe)


def test_a_training_leaves_policy_card_and_json(tiny, tmp_path, capsys, refused):
    out, file = tmp_path / "run", tmp_path / "result.json"
    arguments = ["train", "--recipe", "tiny", "--out", str(out), "--json", str(file)]
    arguments += ["--set", "gamma=0.9"]
    assert cli.main(arguments) == 0
    assert str(out / "policy.onnx") in capsys.readouterr().out
    assert (out / "policy.onnx").exists()
    result = json.loads(file.read_text())
    assert result["history"]
    assert result["options"]["algorithm"]["gamma"] == 0.9
    assert result["robot"] == TINY.robot, "the recipe's own, as no other was named"
    refused(arguments, "--resume")


def test_a_full_disk_leaves_no_half_checkpoint_and_names_the_next_command(
    tiny, tmp_path, refused, monkeypatch
):
    def full(_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(TraceError, match="No space left on device; nothing was changed"):
        checkpoint.write_checkpoint(tmp_path / "checkpoints", 7, {"steps": 7})
    assert not list((tmp_path / "checkpoints").iterdir())
    words = ["train", "--recipe", "tiny", "--out", tmp_path / "run"]
    refused(words, f"the same command with --resume goes on in {tmp_path / 'run'}.")


def test_a_folder_in_which_a_training_goes_on_is_refused(tiny, tmp_path, refused):
    with hold_folder(tmp_path / "run", UsageError):
        refused(["train", "--recipe", "tiny", "--out", tmp_path / "run"], "is in use by")
