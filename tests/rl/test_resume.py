"""What was stopped goes on as if nothing had happened, and nothing else is taken for it."""

from pathlib import Path

import numpy as np
import pytest
import torch

from hopping_leg.controllers.user_controllers import find_user_object
from hopping_leg.envs import RewardTerm
from hopping_leg.errors import UsageError
from hopping_leg.rl import train as module
from hopping_leg.rl.checkpoint import list_checkpoints, read_checkpoint, write_checkpoint
from tests.rl.learners import EVERY, ROBOT, TINY, TINY_UNIVERSAL, learn, policy_file, try_briefly


class KilledError(Exception):
    pass


@pytest.mark.parametrize("name", [*EVERY, "universal"])
def test_a_killed_training_ends_with_the_same_policy(name, tmp_path, monkeypatch):
    try_briefly(monkeypatch)
    recipe = {**EVERY, "universal": TINY_UNIVERSAL.replace(steps=768, workers=2)}[name].replace(
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
    before = read_checkpoint(list_checkpoints(tmp_path / "cut/checkpoints")[-1])["seconds"][1]
    cut = module.train(recipe, ROBOT, 0, tmp_path / "cut", quiet=True, resume=True)
    assert cut.read_bytes() == whole.read_bytes()
    result = module.run_folder.read_result(cut.parent)
    assert result["seconds"]["rollouts"] > before["rollouts"] > 0


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ppo", "window"])
def test_a_cluster_changes_no_bit_and_goes_on_there_or_here(name, tmp_path):
    ray = pytest.importorskip("ray", reason="Ray is not installed (extra 'cluster')")
    (tmp_path / "own.py").write_text("def paid(transition):\n    return transition.action[:, 0]\n")
    _, paid = find_user_object(f"{tmp_path / 'own.py'}:paid")
    terms, made = (RewardTerm("paid", 1.0, paid),), []
    recipe = EVERY[name].replace(workers=2, reward_terms=terms)

    def goes_on(address, state=None):
        made.append(recipe.make_learner(ROBOT, 0, ray=address))
        if state is not None:
            made[-1].restore(read_checkpoint(state)["learner"])
        made[-1].on_boundary = lambda: write_checkpoint(
            tmp_path / f"{len(made)}", made[-1].num_timesteps, {"learner": made[-1].state()}
        )
        return policy_file(recipe, learn(made[-1], recipe.schedule.steps)).content

    ray.shutdown()
    ray.init(num_cpus=2, log_to_driver=False)
    try:
        whole = goes_on(None)
        parts = [collector.task.command for collector in made[0].collectors.here]
        assert not np.intersect1d(*parts).size, "each draws for itself"
        assert goes_on("local") == whole
        there = list_checkpoints(tmp_path / "2")[0]
        assert goes_on("local", there) == goes_on(None, there) == whole
        ray.kill(made[1].collectors._there[0])
        with pytest.raises(UsageError, match=r"died: .* go on, a training with --resume"):
            learn(made[1], 10**6)
        with pytest.raises(UsageError, match=r"4 workers need .* which has 2; give"):
            recipe.replace(workers=4).make_learner(ROBOT, 0, ray="local")
    finally:
        ray.shutdown()


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
