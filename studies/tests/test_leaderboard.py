"""Submissions are whole and hop; judging is fair, goes on where it was, and ranks.

This is the test of a pull request that adds a submission.
"""

import json
import shutil

import numpy as np
import pytest

from hopping_leg.controllers import RolloutConfig, rollout
from hopping_leg.errors import HoppingLegError
from hopping_leg.evaluate.entries import check_range, entry_of
from hopping_leg.evaluate.trials import COMMANDS
from hopping_leg.hop_detection import FLIGHT_CLEARANCE
from hopping_leg.io import json_text
from hopping_leg.robot import load_robot
from hopping_leg.sim import CONTROL_RATE, NO_NOISE
from hopping_leg.sim.perturbation import Perturbation
from studies.leaderboard import judging, submissions
from studies.leaderboard.run import Leaderboard
from studies.leaderboard.submissions import find_submissions, read_submission

LARGEST = 5_000_000
"""Bytes of a folder."""

SHIPPED = find_submissions()


@pytest.mark.parametrize("submission", SHIPPED, ids=lambda one: one.name)
def test_a_submission_is_whole_and_hops_for_a_second(submission):
    facts = submission.facts
    assert facts.authors
    assert all(author.strip() for author in facts.authors)
    assert facts.command.strip()
    assert len(submission.card().split()) >= 20, "the card says too little"
    files = [path for path in submission.folder.rglob("*") if path.is_file()]
    assert sum(path.stat().st_size for path in files) < LARGEST
    controller = submission.load()
    check_range(entry_of(submission.name, controller), COMMANDS)
    leg = RolloutConfig(load_robot(submissions.ROBOT), threads=1)
    commands = np.tile(COMMANDS, (round(CONTROL_RATE), 1))
    run = rollout(controller, leg, commands, seed=0)
    for number, command in enumerate(COMMANDS):
        trace = run.trace(number)
        assert np.isfinite(trace.column("hip_command_nm")).all()
        assert trace.column("foot_clearance_m").max() > FLIGHT_CLEARANCE, f"no flight at {command}"


@pytest.fixture
def mine(tmp_path, monkeypatch):
    """A folder of submissions with one of a class."""
    folder = tmp_path / "submissions" / "mine"
    folder.mkdir(parents=True)
    shutil.copy("examples/bouncer.py", folder / "controller.py")
    (folder / "card.md").write_text("# Mine")
    (folder / "submission.toml").write_text(
        'authors = ["me"]\ncommand = "by hand"\ncontroller = "controller.py:Bouncer"\n'
    )
    monkeypatch.setattr(submissions, "FOLDER", folder.parent)
    return folder


def test_a_class_of_the_folder_is_loaded_and_told_the_robot_of_the_folder(mine):
    robot = 'name = "heavy"\nextends = "legv2"\n'
    (mine / "heavy.toml").write_text(robot)
    with (mine / "submission.toml").open("a") as file:
        file.write('robot = "heavy.toml"\n')
    (found,) = find_submissions()
    assert found.robot().name == "heavy"
    assert found.load().name == "Bouncer"


@pytest.mark.parametrize(
    ("break_it", "said"),
    [
        (lambda folder: (folder / "card.md").unlink(), "has no card.md"),
        (lambda folder: (folder / "submission.toml").unlink(), "has no submission.toml"),
        (lambda folder: rewrite(folder, "authors", "autors"), "Did you mean 'authors'"),
        (lambda folder: rewrite(folder, "by hand", 7), "must be a text"),
        (lambda folder: rewrite(folder, 'controller = "controller.py:Bouncer"', ""), "is missing"),
        (lambda folder: rewrite(folder, "Bouncer", "Jumper"), "There is no class 'Jumper'"),
    ],
)
def test_what_is_wrong_with_a_submission_is_said(mine, break_it, said):
    break_it(mine)
    with pytest.raises(HoppingLegError, match=said):
        read_submission(mine).load()


def rewrite(folder, old, new):
    path = folder / "submission.toml"
    text = path.read_text()
    path.write_text(text.replace(f'"{old}"', str(new)) if new == 7 else text.replace(old, new))


def test_twins_beside_each_other_are_the_legs_that_each_is_alone():
    submission = find_submissions(["fast"])[0]
    twins = (judging.twin(0), judging.twin(1))
    nothing = np.zeros((100, 2))
    perturbed = Perturbation(twins, np.zeros((100, 2, 2)), nothing, nothing)
    believed = RolloutConfig(load_robot(submissions.ROBOT), NO_NOISE, threads=1)
    asked = np.full((100, 2), 0.3)
    both = rollout(submission.load(), believed, asked, 0, perturbation=perturbed)
    alone = rollout(submission.load(), RolloutConfig(twins[0], NO_NOISE, threads=1), asked, 0)
    np.testing.assert_array_equal(
        both.trace(0).column("hip_torque_nm"), alone.trace(0).column("hip_torque_nm")
    )
    assert (both.data["height_m"][:, 0] != both.data["height_m"][:, 1]).any()


def small(folder, *names, twins=2):
    return Leaderboard(names, twins=twins, seeds=1, seconds=3.0, jobs=1, folder=folder)


def test_what_is_judged_is_not_judged_again_and_what_changed_is(mine, tmp_path, monkeypatch):
    monkeypatch.setattr(judging, "AXES", ("delay",))
    first = small(tmp_path / "runs", "mine").measure()
    assert {row["axis"] for row in first["scores"]} == {"delay"}
    (row,) = first["submissions"]
    assert row["twins_low"] <= row["twins"] <= row["twins_high"]
    runs = []
    monkeypatch.setattr(judging.Judgement, "run", lambda job, quiet: runs.append(job.name))
    assert json_text(small(tmp_path / "runs", "mine").measure()) == json_text(first)
    assert runs == []
    small(tmp_path / "runs", "mine", twins=3).measure()
    assert runs == ["mine, twins"]
    (mine / "controller.py").write_text((mine / "controller.py").read_text() + "\n# changed\n")
    with pytest.raises(FileNotFoundError):  # as nothing is run here
        small(tmp_path / "runs", "mine").measure()
    assert runs == ["mine, twins", "mine, twins", "mine, robustness"]


def test_results_are_json_and_ranked(tmp_path, monkeypatch):
    monkeypatch.setattr(judging, "AXES", ("delay",))
    monkeypatch.setattr(judging.Judgement, "run", pretend)
    result = small(tmp_path, "fast", "precise", "energy-shaping").measure()
    assert str(tmp_path) not in json_text(result)
    ranks = [row["twins"] for row in result["submissions"]]
    assert ranks == sorted(ranks, reverse=True)
    assert result["submissions"][0]["submission"] == "precise"


def pretend(job, quiet):
    """Store a made-up result: who has the longest name misses most."""
    miss = {"precise": 0.001, "fast": 0.021}.get(job.submission.name, 0.03)
    one = {"level": 0.0, "command_m": 0.3, "repeat": 0, "error_m": miss, "missed": False}
    outcomes = [{**one, "repeat": k, "skipped": 0, "contacts": 0} for k in range(2)]
    row = {
        "controller": job.submission.name,
        "axis": "delay",
        "score": 0.5,
        "low": 0.1,
        "high": 0.9,
    }
    result = {"outcomes": outcomes, "scores": [row, {**row, "axis": "overall"}]}
    job.file.parent.mkdir(parents=True, exist_ok=True)
    job.file.write_text(json.dumps({"asked": job.asked, "result": result}))
