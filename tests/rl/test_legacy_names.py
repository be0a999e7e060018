"""Runs of version 0.1 go on under the names of today."""

import json
from pathlib import Path

import pytest

from hopping_leg.errors import UsageError
from hopping_leg.rl.legacy_names import upgrade_checkpoint, upgrade_config
from hopping_leg.rl.recipes import change, get_recipe
from hopping_leg.rl.run_folder import RunFolder
from hopping_leg.robot import load_robot

STORED = json.loads((Path(__file__).parent / "config_0.1.json").read_text())
CHANGES = [
    "num_envs=4", "n_steps=32", "eval_every=64", "eval_start=0.5", "steps=512", "batch_size=64",
    "checkpoint_seconds=0", "teacher_share=0.5", "dagger.gradient_steps=4", "dagger.batch_size=64",
    "task.command_skew=1", "n_epochs=4", "teachers=1", "student.memory=gru",
]  # fmt: skip


def test_a_recurrent_run_is_one_of_precise_with_a_gru(tmp_path):
    recipe = change(get_recipe("precise"), CHANGES).replace(
        {"task.observation": "dated", "task.command_range": (0.2, 0.42)},
        eval_commands=(0.22, 0.25, 0.28, 0.31, 0.34, 0.37, 0.40),
    )
    folder = RunFolder(tmp_path, recipe, load_robot("legv2-paper"), 3, None)
    folder.write("config.json", STORED)
    folder.check_same()


def test_a_configuration_of_today_stays_as_it_is():
    upgraded = upgrade_config(STORED)
    assert upgrade_config(upgraded) == upgraded


@pytest.mark.parametrize("gone", [{"exam_at": [0.5, 1.0]}, {"task": {"idle": 1.5}}])
def test_what_can_no_longer_be_trained_is_refused(gone):
    with pytest.raises(UsageError, match="no longer"):
        upgrade_config({**STORED, "options": {**STORED["options"], **gone}})


def test_a_checkpoint_gets_the_names_of_today():
    task = {"hopped": 1, "reward": {"air": [0.0], "since": [0.0]}}
    tree = {"model": {"own": {"exams": [0.1]}, "env": {"task": task}}}
    model = upgrade_checkpoint(tree)["model"]
    assert model["own"] == {"teacher_scores": [0.1]}
    assert model["env"]["task"] == {"reward": {"apex": {"air": [0.0], "since": [0.0]}}}
