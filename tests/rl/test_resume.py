"""What was stopped goes on as if nothing had happened, and nothing else is taken for it."""

from pathlib import Path

import numpy as np
import pytest
import torch

from hopping_leg.errors import UsageError
from hopping_leg.rl import train as module
from hopping_leg.rl.checkpoint import list_checkpoints, read_checkpoint, write_checkpoint
from tests.rl.learners import EVERY, ROBOT, TINY, TINY_UNIVERSAL, try_briefly


class KilledError(Exception):
    pass


@pytest.mark.parametrize("name", [*EVERY, "universal"])
def test_a_killed_training_ends_with_the_same_policy(name, tmp_path, monkeypatch):
    try_briefly(monkeypatch)
    recipe = {**EVERY, "universal": TINY_UNIVERSAL.replace(steps=768)}[name].replace(
        eval_every=192, checkpoint_seconds=0
    )

    class Killed(module.Trainer):
        def _evaluate(self):
            super()._evaluate()
            if self.learner.num_timesteps >= 384:
                torch.rand(100)
                np.random.rand(100)  # noqa: NPY002
                raise KilledError

    whole = module.train(recipe, ROBOT, 0, tmp_path / "whole", quiet=True)
    trainer = module.Trainer
    monkeypatch.setattr(module, "Trainer", Killed)
    with pytest.raises(KilledError):
        module.train(recipe, ROBOT, 0, tmp_path / "cut", quiet=True)
    monkeypatch.setattr(module, "Trainer", trainer)
    cut = module.train(recipe, ROBOT, 0, tmp_path / "cut", quiet=True, resume=True)
    assert cut.read_bytes() == whole.read_bytes()


def test_only_whole_checkpoints_count_two_are_kept_and_no_code_in_them_runs(tmp_path):
    for steps in (1, 2, 3):
        write_checkpoint(tmp_path, steps, {"a": np.arange(steps), "b": [steps, None, 2**100]})
    (tmp_path / "checkpoint-000000000009.pt.part").touch()
    found = list_checkpoints(tmp_path)
    assert [p.stem[-1] for p in found] == ["2", "3"]
    tree = read_checkpoint(found[-1])
    assert (tree["a"].tolist(), tree["b"]) == ([0, 1, 2], [3, None, 2**100])
    content, place = found[-1].read_bytes(), np.arange(3).tobytes()
    found[-1].write_bytes(content.replace(place, np.arange(1, 4).tobytes()))
    torch.save({"a": Path("code")}, found[0])
    for path in found:
        with pytest.raises(UsageError, match="is damaged"):
            read_checkpoint(path)


def test_a_run_is_never_overwritten_or_mixed(tmp_path, monkeypatch):
    try_briefly(monkeypatch)
    recipe, out = TINY.replace(steps=64, eval_every=32, learning_starts=32), tmp_path / "run"
    done = module.train(recipe, ROBOT, 0, out, quiet=True)
    content = done.read_bytes()
    for seed, resume, says in ((0, 0, "--resume"), (0, 1, "finished"), (1, 1, "another seed")):
        with pytest.raises(UsageError, match=says):
            module.train(recipe, ROBOT, seed, out, resume=bool(resume), quiet=True)
    assert done.read_bytes() == content
    done.unlink()
    write_checkpoint(out / "checkpoints", 64, {"learner": []})
    with pytest.raises(UsageError, match="another version"):
        module.train(recipe, ROBOT, 0, out, resume=True, quiet=True)
