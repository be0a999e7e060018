"""A benchmark of trainings trains none twice and tells how the teachers did."""

import json

import pytest

from hopping_leg.rl import parallel_seeds as module
from hopping_leg.rl.recipes import get_recipe
from studies.training_time import run as bench


@pytest.fixture
def complete(tmp_path):
    """Return a folder with one complete training, with seed 3."""
    run = tmp_path / "fast-seed3"
    (run / "snapshots").mkdir(parents=True)
    (run / "policy.onnx").write_bytes(b"selected")
    (run / "snapshots" / "000000000500.onnx").write_bytes(b"snapshot")
    history = [{"steps": 500, "minutes": 0.5}]
    result = {"minutes": 1.0, "steps": 1000, "history": history, "teacher_scores_m": [0.02, 0.004]}
    (run / "result.json").write_text(json.dumps(result), encoding="utf-8")
    return tmp_path


def judge(policies, recipe, _robot, _seeds):
    """Say that every policy is 1 mm off at every command."""
    fields = {"median_error_m": -0.001, "std_m": 0.002}
    return [
        {"controller": p, "command_m": c, **fields}
        for p in policies
        for c in recipe.selection.eval_commands
    ]


def test_what_is_complete_is_judged_and_not_trained_again(monkeypatch, complete, robot):
    monkeypatch.setattr(module, "train", lambda *_args, **_options: pytest.fail("trained again"))
    monkeypatch.setattr(bench, "_judge", judge)
    result = bench.bench_training(get_recipe("fast"), robot, complete, training_seeds=[3])
    (run,) = result["runs"]
    assert (run["seed"], run["steps"], run["teacher_scores_m"]) == (3, 1000, [0.02, 0.004])
    errors = {"worst_abs_median_error_m": 0.001, "mean_abs_median_error_m": 0.001, "std_m": 0.002}
    assert result["curve"] == [{"seed": 3, "steps": 500, "minutes": 0.5, **errors}]
    assert (result["minutes_max"], result["worst_abs_median_error_m"]) == (1.0, 0.001)


def test_what_is_missing_is_trained_by_the_clock(monkeypatch, complete, robot):
    begun = []

    def train(_recipe, _robot, seed, out, **options):
        begun.append((seed, options["minutes"], options["resume"]))
        out.mkdir()
        (out / "policy.onnx").write_bytes(b"selected")
        result = {"minutes": 2.0, "steps": 10, "history": []}
        (out / "result.json").write_text(json.dumps(result), encoding="utf-8")

    monkeypatch.setattr(module, "train", train)
    monkeypatch.setattr(bench, "_judge", judge)
    recipe = get_recipe("fast")
    result = bench.bench_training(recipe, robot, complete, training_seeds=[3, 4], minutes=2.0)
    assert begun == [(4, 2.0, False)]
    assert [run["teacher_scores_m"] for run in result["runs"]] == [[0.02, 0.004], []]
    assert result["minutes_max"] == 2.0


def test_of_several_starts_the_one_that_went_on_is_judged(monkeypatch, tmp_path, robot):
    begun = []

    class Fake:
        def __init__(self, _recipe, _robot, seed, out, count, minutes, threads):
            self.out = out
            self.folder = lambda number: out / f"start-{number}"
            begun.append((seed, count, minutes, threads))

        def train(self, *, resume):
            assert not resume
            run = self.out / "start-1"
            (run / "snapshots").mkdir(parents=True)
            (run / "snapshots" / "000000000500.onnx").write_bytes(b"snapshot")
            history = [{"steps": 500, "minutes": 0.5}]
            result = {"seed": 15, "minutes": 1.0, "steps": 9, "history": history}
            (run / "result.json").write_text(json.dumps(result), encoding="utf-8")
            result |= {"seed": 7, "chosen_seed": 1, "seed_scores": [{"seed": 14}, {"seed": 15}]}
            (self.out / "result.json").write_text(json.dumps(result), encoding="utf-8")
            (self.out / "policy.onnx").write_bytes(b"best")

    monkeypatch.setattr(bench, "ParallelSeeds", Fake)
    monkeypatch.setattr(bench, "_judge", judge)
    options = {"minutes": 3.0, "threads": 1, "parallel_seeds": 2}
    result = bench.bench_training(
        get_recipe("fast"), robot, tmp_path, training_seeds=[7], **options
    )
    assert begun == [(7, 2, 3.0, 1)]
    (run,) = result["runs"]
    assert (run["seed"], run["chosen_seed"]) == (7, 1)
    assert [start["seed"] for start in run["seed_scores"]] == [14, 15]
    assert [(point["seed"], point["steps"]) for point in result["curve"]] == [(7, 500)]
