"""A study searches where it says, shares its trials, and goes on after whatever stopped it."""

import dataclasses
import json
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import pytest

from hopping_leg.cli import main
from hopping_leg.errors import PhysicsError, UsageError
from hopping_leg.rl import tuning
from hopping_leg.rl.recipes import RECIPES, SPACES
from hopping_leg.rl.search_space import Tuning, defaults
from hopping_leg.rl.tuning import open_study, tune
from hopping_leg.rl.tuning_figures import FIGURES
from tests.clusters import local


@pytest.fixture
def small(tmp_path):
    return Tuning(
        "fast", f"sqlite:///{tmp_path}/study.db", tmp_path / "runs", trials=6, steps=100,
        snapshots=4, startup=2, heartbeat=1,
    )  # fmt: skip


@pytest.fixture
def trained(monkeypatch):
    """Replace training by one whose score is how far its learning rate lies from 1e-3."""
    calls = []

    def train(recipe, robot, seed, folder, *, resume, quiet, on_snapshot):
        calls.append((recipe, folder))
        score = abs(recipe.algorithm.learning_rate - 1e-3) + 0.01
        for steps in (25, 50, 75, 100):
            on_snapshot(steps, score * (2 - steps / 100))
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "result.json").write_text(json.dumps({"selected": {"score_m": score}}))
        (folder / "policy.onnx").write_bytes(b"")

    monkeypatch.setattr(tuning, "train", train)
    return calls


@pytest.mark.parametrize("name", SPACES)
def test_every_searched_number_is_the_recipes_and_its_own_value_can_be_found(name):
    recipe = RECIPES[name]
    assert SPACES[name].keys() <= dict(recipe.paths()).keys()
    stored = defaults(recipe, SPACES[name])
    assert all(isinstance(value, int | float | str) for value in stored.values())


def test_the_first_trial_is_the_recipe_as_it_is_and_all_are_recorded(small, trained):
    result = tune(small)
    (first, folder), *_ = trained
    fast = RECIPES["fast"]
    assert (first.algorithm, first.network) == (fast.algorithm, fast.network)
    assert (first.schedule.steps, first.selection.eval_every) == (100, 25)
    assert folder == small.out / "trial-0000"
    trials = result["trials"]
    assert [trial["number"] for trial in trials] == list(range(6))
    assert {trial["state"] for trial in trials} <= {"complete", "pruned"}
    scores = [trial["score_m"] for trial in trials if trial["state"] == "complete"]
    assert result["best"]["score_m"] == min(scores)
    assert all(len(trial["snapshots_m"]) == 4 for trial in trials if trial["score_m"] is not None)
    json.dumps(result, allow_nan=False)


def test_a_study_goes_on_without_repeating_itself_and_gives_up_what_lags(small, trained):
    tune(small)
    assert len(trained) == 6
    tune(small)
    assert len(trained) == 6
    result = tune(dataclasses.replace(small, trials=12))
    assert len(trained) == 12
    rates = [trial["params"]["learning_rate"] for trial in result["trials"]]
    assert len(set(rates)) == 12
    pruned = [trial for trial in result["trials"] if trial["state"] == "pruned"]
    assert pruned
    assert all(len(trial["snapshots_m"]) < 4 and trial["score_m"] is None for trial in pruned)


def test_a_failed_training_counts_and_says_why(small, monkeypatch):
    def train(*args, **kwargs):
        raise PhysicsError("it blew up")

    monkeypatch.setattr(tuning, "train", train)
    result = tune(dataclasses.replace(small, trials=2))
    assert [trial["error"] for trial in result["trials"]] == ["PhysicsError: it blew up"] * 2
    assert result["best"] is None
    assert result["importance"] == {}


def test_an_interrupted_trial_is_taken_up_in_its_folder(small, trained, monkeypatch):
    def interrupted(*args, **kwargs):
        raise KeyboardInterrupt

    whole = tuning.train
    monkeypatch.setattr(tuning, "train", interrupted)
    with pytest.raises(KeyboardInterrupt):
        tune(small)
    monkeypatch.setattr(tuning, "train", whole)
    result = tune(dataclasses.replace(small, trials=1))
    first, second = result["trials"]
    assert (first["state"], second["state"]) == ("fail", "complete")
    assert second["goes_on_from"] == 0
    assert second["params"] == first["params"]
    assert trained[0][1] == small.out / "trial-0000"


@pytest.mark.slow
def test_a_killed_trial_is_taken_up_once_it_gives_no_sign_of_life(small, trained):
    study = open_study(small)
    trial = study.ask()
    trial.suggest_float("learning_rate", 2e-4, 4e-3, log=True)
    study._storage.record_heartbeat(trial._trial_id)
    time.sleep(4 * small.heartbeat)
    result = tune(dataclasses.replace(small, trials=2))
    assert result["trials"][0]["state"] == "fail"
    again = [t for t in result["trials"] if t["goes_on_from"] == 0]
    assert [t["state"] for t in again] == ["complete"]


def test_another_search_in_the_same_study_is_refused(small, trained):
    tune(dataclasses.replace(small, trials=1))
    with pytest.raises(UsageError, match="another 'steps'"):
        tune(dataclasses.replace(small, steps=200))
    with pytest.raises(UsageError, match="Cannot use the database"):
        tune(dataclasses.replace(small, study="sqlite:////no/such/folder/x.db"))
    for wrong in ({"trials": 0}, {"seed": -1}):
        with pytest.raises(UsageError):
            dataclasses.replace(small, **wrong)


BRIEF = [
    "tune", "paper", "--trials", "3", "--steps", "128", "--snapshots", "1", "--set", "num_envs=2",
]  # fmt: skip
SHARED = """
from hopping_leg.cli import main
from hopping_leg.rl import policy_evaluation

policy_evaluation.evaluate_policy.__kwdefaults__["seconds"] = 0.5
if __name__ == "__main__":
    raise SystemExit(main({words!r}))
"""


@pytest.mark.slow
def test_two_processes_share_a_study_and_leave_everything(tmp_path, capsys):
    out, script, study = tmp_path / "out", tmp_path / "script.py", tmp_path / "deep" / "study.db"
    words = [*BRIEF, "--workers", "2", "--study", str(study), "--out", str(out)]
    script.write_text(SHARED.format(words=words))
    result = subprocess.run([sys.executable, script], capture_output=True, text=True, timeout=900)
    assert result.returncode == 0, result.stderr
    assert study.exists()
    trials = json.loads((out / "trials.json").read_text())["trials"]
    complete = [trial["number"] for trial in trials if trial["state"] == "complete"]
    assert len(complete) == 3
    assert f"{len(complete)} complete" in result.stdout
    folders = {path.name for path in out.glob("trial-*")}
    assert folders == {f"trial-{number:04d}" for number in complete}
    assert all((out / f"trial-{number:04d}" / "policy.onnx").exists() for number in complete)
    assert {f"{name}.svg" for name in FIGURES} <= {path.name for path in out.iterdir()}
    assert main(["tune", "fast", "--set", "legz=2", "--study", str(tmp_path / "b.db")]) == 2
    assert "legz" in capsys.readouterr().err


@pytest.mark.slow
def test_a_ray_cluster_works_on_a_study(tmp_path, monkeypatch):
    def judge_briefly():
        from hopping_leg.rl import policy_evaluation

        policy_evaluation.evaluate_policy.__kwdefaults__["seconds"] = 0.5

    monkeypatch.chdir(tmp_path)
    words = [*BRIEF, "--study", "study.db", "--out", "out", "--ray", "local"]
    with local(runtime_env={"worker_process_setup_hook": judge_briefly}):
        assert main(words) == 0
    out = tmp_path / "out"
    result = json.loads((out / "trials.json").read_text())
    complete = [trial for trial in result["trials"] if trial["state"] == "complete"]
    assert len(complete) == 3
    assert all((out / f"trial-{t['number']:04d}" / "policy.onnx").exists() for t in complete)
    first, second = sorted(complete, key=lambda trial: trial["number"])[:2]
    assert first["params"] != second["params"]


def test_a_waiting_trial_is_given_to_one_worker_only(small):
    waiting, workers = 20, 4
    study = open_study(small)
    for number in range(1, waiting):
        study.enqueue_trial({"learning_rate": 10 ** (-3 - number / waiting)})
    together = threading.Barrier(workers)

    def take(worker):
        own = open_study(small, worker)
        together.wait()
        return [own.ask().number for _ in range(waiting // workers)]

    with ThreadPoolExecutor(workers) as crew:
        taken = [number for numbers in crew.map(take, range(workers)) for number in numbers]
    assert sorted(taken) == list(range(waiting))


def test_a_file_is_no_database_for_machines_elsewhere(small, monkeypatch):
    class Cluster:
        elsewhere = ("node-2", "node-3")

        def __init__(self, address, count):
            assert address == "10.0.0.1:6379"

    monkeypatch.setattr(tuning, "RayWorkers", Cluster)
    with pytest.raises(UsageError, match=r"node-2, node-3 cannot share .* postgresql"):
        tune(small, ray="10.0.0.1:6379")
    assert not (small.out.parent / "study.db").exists()
