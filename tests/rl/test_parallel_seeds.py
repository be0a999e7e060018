"""Of several trainings side by side the best is kept, and none outlives who began them."""

import dataclasses
import itertools
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from unittest.mock import Mock

import pytest

from hopping_leg.errors import UsageError
from hopping_leg.rl import parallel_seeds as module
from hopping_leg.rl import policy_evaluation
from hopping_leg.rl.checkpoint import list_checkpoints
from hopping_leg.rl.distillation.distillation import Distillation
from hopping_leg.rl.parallel_seeds import ParallelSeeds
from hopping_leg.rl.policy_evaluation import CommandResult, command_score, score
from hopping_leg.rl.run_folder import RunFolder
from hopping_leg.rl.train import train
from tests.rl.learners import ROBOT, TINY, TINY_LEARNT


def leave(folder, *, score, minutes, policy):
    """Leave what a start leaves: what decides, and a finished training if it has a policy."""
    folder.path.mkdir(exist_ok=True)
    decision = {"seed": folder.config["seed"], "score_m": score, "minutes": minutes}
    folder.write("decision.json", decision)
    if policy:
        selected = {"steps": 800, "minutes": 0.9, "score_m": 1.0, "finalists": [1]}
        selected |= {"trials": [], "seeds": [501]}
        result = {"command": "", "minutes": 9.0, "steps": 1600, "history": [1]}
        folder.write("result.json", {**folder.config, **result, "selected": selected})
        folder.policy.write_bytes(policy)


@pytest.mark.parametrize("finished", [True, False])
@pytest.mark.parametrize(("scores", "best"), [((0.004, 0.003), 1), ((0.003, 0.004, 0.02), 0)])
def test_the_best_goes_on_with_the_threads_of_all(scores, best, finished, tmp_path, monkeypatch):
    out, trained = tmp_path / "run", []

    def start(number):
        return RunFolder(out / f"start-{number}", TINY, ROBOT, 100 + number, None)

    def work(_starts, number):
        policy = b"policy %d" % number if finished else None
        leave(start(number), score=scores[number], minutes=3.0 + number, policy=policy)

    def train(_recipe, _robot, _seed, folder, **options):
        number = int(folder.name[-1])
        trained.append((number, options["threads"]))
        leave(start(number), score=0, minutes=0, policy=b"policy %d" % number)
        leave(start(number), score=scores[number], minutes=3.0 + number, policy=None)

    monkeypatch.setattr(ParallelSeeds, "work", work)
    monkeypatch.setattr(module.ProcessWorkers, "map", lambda _, f, args: [f(*a) for a in args])
    monkeypatch.setattr(module, "train", train)
    several = ParallelSeeds(TINY, ROBOT, 5, out, len(scores), threads=2, quiet=True)
    result = several.train()
    assert trained == ([] if finished else [(best, 2 * len(scores))])
    assert result.policy.read_bytes() == b"policy %d" % best
    stored = json.loads((out / "result.json").read_text())
    assert [row["score_m"] for row in stored["seed_scores"]] == list(scores)
    assert f"--seed 5 --parallel-seeds {len(scores)}" in stored["command"]
    # Who is ready first waits for the last.
    assert result.minutes == stored["minutes"] == 9.0 + (len(scores) - 1 - best)
    card = (out / "model_card.md").read_text()
    assert f"the training with seed {100 + best}, the best of {len(scores)}" in card
    with pytest.raises(UsageError, match="is finished"):
        several.train(resume=True)


def test_a_start_stops_at_the_exam_of_its_teacher_and_goes_on_from_there(tmp_path, monkeypatch):
    monkeypatch.setattr(policy_evaluation, "_SECONDS", 0.5)
    monkeypatch.setattr(Distillation, "evaluate_teacher", lambda *_args: 0.005)
    several = ParallelSeeds(TINY_LEARNT, ROBOT, 1, tmp_path, 2, quiet=True)
    several.work(1)
    run = several.folder(1)
    decision = json.loads((run / "decision.json").read_text())
    assert (decision["seed"], decision["score_m"]) == (3, 0.005)
    (last,) = list_checkpoints(run / "checkpoints")
    stopped = int(last.name.split("-")[-1])
    # Each of three teachers learns for a third of 0.4 of the steps.
    assert TINY_LEARNT.schedule.steps * 0.4 / 3 <= stopped < TINY_LEARNT.schedule.steps / 2
    assert not (run / "policy.onnx").exists()
    several.work(1)
    assert list_checkpoints(run / "checkpoints") == [last]
    alone = train(TINY_LEARNT, ROBOT, 3, tmp_path / "alone", quiet=True)
    going_on = train(TINY_LEARNT, ROBOT, 3, run, resume=True, quiet=True)
    assert going_on.policy.read_bytes() == alone.policy.read_bytes()


def test_no_two_seeds_share_a_start(tmp_path, monkeypatch):
    train = Mock(side_effect=UsageError("no time for that"))
    monkeypatch.setattr(module, "train", train)
    for seed, number in itertools.product(range(4), range(3)):
        with pytest.raises(UsageError, match="no time"):
            ParallelSeeds(TINY, ROBOT, seed, tmp_path, 3).work(number)
    assert len({call.args[2] for call in train.call_args_list}) == 12


def test_starts_are_compared_on_seeds_that_chose_none_of_their_snapshots():
    others = {policy_evaluation.FIRST_SEED, *policy_evaluation.FINAL_SEEDS}
    assert not set(policy_evaluation.DECIDING_SEEDS) & others
    assert max(policy_evaluation.DECIDING_SEEDS) < 1000


def test_no_height_between_two_commands_is_missed():
    heights = policy_evaluation.every_centimetre((0.435, 0.225, 0.3))
    assert (heights[0], heights[-1]) == (0.225, 0.435)
    steps = [high - low for low, high in itertools.pairwise(heights)]
    assert steps == pytest.approx([0.01] * 21)
    assert policy_evaluation.every_centimetre((0.3,)) == (0.3,)


def test_a_single_start_is_a_training_in_the_folder_itself(tmp_path, monkeypatch):
    begun = []

    def train(_recipe, _robot, seed, out, **options):
        begun.append((seed, out, options["resume"], options["source"], options["on_early_score"]))

    monkeypatch.setattr(module, "train", train)
    ParallelSeeds(TINY, ROBOT, 7, tmp_path, 1, source=tmp_path / "before").train(resume=True)
    ParallelSeeds(TINY, ROBOT, 7, tmp_path, 1).train()
    before = tmp_path / "before"
    assert begun == [(7, tmp_path, True, before, None), (7, tmp_path, False, None, None)]


@pytest.mark.parametrize(("count", "says"), [(0, "at least 1"), (2, "leave --parallel-seeds out")])
def test_no_start_and_several_from_one_source_are_refused(count, says, tmp_path):
    out = tmp_path / "run"
    with pytest.raises(UsageError, match=says):
        ParallelSeeds(TINY, ROBOT, 0, out, count, source=tmp_path).train()
    assert not out.exists()


_SEVERAL = """
import sys
from pathlib import Path
from hopping_leg.rl.parallel_seeds import ParallelSeeds
from tests.rl.learners import ROBOT, TINY
recipe = TINY.replace(steps=1600, checkpoint_seconds=0.0, eval_commands=(0.3,))
ParallelSeeds(recipe, ROBOT, 1, Path(sys.argv[1]), 2, quiet=True).train(resume=True)
"""


def checkpoints(out):
    return {path for k in range(2) for path in list_checkpoints(out / f"start-{k}" / "checkpoints")}


ENVIRONMENT = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
COMMAND = [sys.executable, "-c", _SEVERAL]


@pytest.mark.slow
def test_workers_end_with_who_began_them_and_go_on_with_the_next(tmp_path, monkeypatch):
    interrupt(tmp_path / "interrupted", signal.SIGINT)
    out, alone = tmp_path / "killed", tmp_path / "alone"
    interrupt(out, signal.SIGKILL)
    subprocess.run([*COMMAND, str(out)], check=True, env=ENVIRONMENT)
    monkeypatch.setattr(module.ProcessWorkers, "map", lambda _, f, args: [f(*a) for a in args])
    monkeypatch.setattr(sys, "argv", ["-c", str(alone)])
    exec(_SEVERAL, {})
    for name in ("policy.onnx", "start-0/policy.onnx", "start-1/policy.onnx"):
        assert (out / name).read_bytes() == (alone / name).read_bytes()


def interrupt(out, how):
    """Interrupt trainings soon after they have begun; nobody must go on with them."""
    process = subprocess.Popen([*COMMAND, str(out)], env=ENVIRONMENT)
    while process.poll() is None and not checkpoints(out):
        time.sleep(0.01)
    process.send_signal(how)
    process.wait(20)
    time.sleep(2)
    left = checkpoints(out)
    assert left
    time.sleep(2)
    assert checkpoints(out) == left, "a worker goes on without the process that began it"


USUAL = {
    "median_error_m": 0.001, "std_m": 0.003, "hops": 300, "hops_per_s": 2.3, "flight_fraction": 0.6,
    "skipped_hops": 0, "body_contact_ticks": 0, "min_height_m": 0.1,
}  # fmt: skip
CALM = [CommandResult(command_m=command, **USUAL) for command in (0.25, 0.30, 0.35)]


def changed(**values):
    """Return the trials with something else at the lowest command."""
    return [dataclasses.replace(CALM[0], **values), *CALM[1:]]


def test_a_score_is_the_mean_of_error_and_scatter():
    assert score(CALM) == pytest.approx(0.004)


@pytest.mark.parametrize("fault", ["skipped_hops", "body_contact_ticks"])
def test_who_fails_once_in_hundreds_of_hops_loses_to_who_scatters_a_little_more(fault):
    wider = [dataclasses.replace(v, std_m=0.005) for v in CALM]
    assert score(CALM) < score(wider) < score(changed(**{fault: 1}))


def test_failing_more_often_is_worse():
    assert score(changed(skipped_hops=1)) < score(changed(skipped_hops=30))


def test_heights_out_of_order_are_worse_than_any_scatter():
    wide = [dataclasses.replace(v, std_m=0.03) for v in CALM]
    assert score(wide) < score(changed(median_error_m=0.06))


def test_a_command_without_hops_is_a_metre_off():
    assert command_score(dataclasses.replace(CALM[0], hops=0, std_m=float("nan"))) == 1.0
