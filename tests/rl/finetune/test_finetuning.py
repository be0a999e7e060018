"""Trials, learning and stopping as a whole, on a robot that is made up or simulated."""

import dataclasses
import json
import shutil

import numpy as np
import pytest

from hopping_leg.controllers.command_schedule import CommandSchedule
from hopping_leg.controllers.policy import Policy
from hopping_leg.errors import UsageError
from hopping_leg.rl.finetune import apex_estimate, replay
from hopping_leg.rl.finetune.apex_estimate import prepare
from hopping_leg.rl.finetune.config import StoppingRules, Task
from hopping_leg.rl.finetune.finetuning import POLICY as FILE
from hopping_leg.rl.finetune.finetuning import Finetuning, finetune
from hopping_leg.rl.finetune.simulated import Guard, SimulatedTrials
from hopping_leg.robot import load_robot

from .trials import OPTIONS, POLICY, ROBOT, Imagined

TASK = Task(POLICY, ROBOT, (0.25, 0.35), 3)


@pytest.fixture(scope="module")
def ready(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pretraining")
    prepare(POLICY, ROBOT, OPTIONS.contact, folder)
    return folder


@pytest.fixture(autouse=True)
def few_legs(monkeypatch):
    monkeypatch.setattr(replay, "BELIEVED_LEGS", 2)


class KilledError(Exception):
    pass


def test_what_is_learnt_beforehand_is_learnt_once(ready, monkeypatch):
    def never(*_):
        raise AssertionError("simulated again")

    monkeypatch.setattr(apex_estimate, "doubtful_legs", never)
    again = prepare(POLICY, ROBOT, OPTIONS.contact, ready)
    assert again.drag.shape == (2,)
    other = dataclasses.replace(OPTIONS.contact, seed=6)
    with pytest.raises(AssertionError, match="simulated again"):
        prepare(POLICY, ROBOT, other, ready)


@pytest.mark.slow
def test_a_killed_run_goes_on_exactly(tmp_path, ready):
    whole = finetune(TASK, Imagined(), OPTIONS, tmp_path / "whole", pretraining=ready)
    kinds = [row["kind"] for row in whole["outings"]]
    assert {"check", "exploration"} <= set(kinds)
    for number in (1, 3, 4):

        def kill(row, at=number):
            if row["outing"] == at:
                raise KilledError

        with pytest.raises(KilledError):
            finetune(TASK, Imagined(), OPTIONS, tmp_path / "cut", resume=number > 1,
                  pretraining=ready, on_trial=kill)  # fmt: skip
    cut = finetune(TASK, Imagined(), OPTIONS, tmp_path / "cut", resume=True, pretraining=ready)
    assert cut["outings"] == whole["outings"]
    assert (tmp_path / "cut" / FILE).read_bytes() == (tmp_path / "whole" / FILE).read_bytes()


@pytest.mark.slow
def test_weights_move_and_the_policy_file_names_its_source(tmp_path, ready):
    options = dataclasses.replace(OPTIONS, method="sac")
    run = Finetuning(TASK, Imagined(), options, tmp_path, ready)
    content, reason = run.run()
    assert run._content(run._network, run._correction) != content
    card = Policy(content, "finetuned", "finetuned").card
    assert POLICY.digest in card.recipe
    assert card.robot_digest == POLICY.card.robot_digest
    assert "used up" in reason


def test_trials_that_were_ended_early_never_win_and_are_counted(tmp_path, ready):
    options = dataclasses.replace(OPTIONS, method="aim")
    robot = Imagined(complain_from=1)
    result = finetune(TASK, robot, options, tmp_path, pretraining=ready)
    assert result["safety"]["ended_early"] == len(result["outings"]) - 1
    assert result["best_check"]["outing"] == 0
    strict = dataclasses.replace(
        options, stopping_rules=StoppingRules(minutes=0.4, margin=0.01, patience=50)
    )
    shutil.rmtree(tmp_path)
    again = finetune(TASK, Imagined(complain_from=1), strict, tmp_path, pretraining=ready)
    assert again["safety"]["rolled_back"] > 0


def test_an_exploration_that_was_ended_early_goes_back_to_the_best_policy(tmp_path, ready):
    options = dataclasses.replace(OPTIONS, method="sac")
    result = finetune(TASK, Imagined(complain_from=3), options, tmp_path, pretraining=ready)
    for row in result["outings"]:
        assert row["rolled_back"] or not (row["complaint"] and row["kind"] == "exploration")
    assert any(row["complaint"] for row in result["outings"] if row["kind"] == "exploration")


def test_a_folder_with_another_run_is_refused(tmp_path, ready):
    options = dataclasses.replace(OPTIONS, method="aim")
    finetune(TASK, Imagined(), options, tmp_path, pretraining=ready)
    with pytest.raises(UsageError, match="--resume"):
        finetune(TASK, Imagined(), options, tmp_path, pretraining=ready)
    with pytest.raises(UsageError, match="another seed"):
        finetune(dataclasses.replace(TASK, seed=4), Imagined(), options, tmp_path, resume=True)
    with pytest.raises(UsageError, match="finished"):
        finetune(TASK, Imagined(), options, tmp_path, resume=True)
    assert json.loads((tmp_path / "finetune.json").read_text())["on"] == "imagined"


def test_a_simulated_trial_tells_what_was_measured_and_keeps_the_truth_apart():
    twin = load_robot("twin")
    trial = SimulatedTrials(twin, None).hop(POLICY, CommandSchedule(((0.3, 2.0),)), 1)
    again = SimulatedTrials(twin, None).hop(POLICY, CommandSchedule(((0.3, 2.0),)), 1)
    assert trial.trace.table.equals(again.trace.table)
    assert not {"height_m", "foot_clearance_m"} & set(trial.trace.table.columns)
    noise = np.diff(trial.trace.column("hip_velocity_rad_s")[:20])
    assert np.abs(noise).max() > 0.01
    assert trial.seconds == 2.0
    assert len(trial.truth) >= 3


def test_a_guard_takes_the_leg_away_and_ends_the_trial():
    narrow = Guard(np.array([-9.0, -9.0]), np.array([9.0, 9.0]), np.array([9.0, 9.0]), np.zeros(2))
    trial = SimulatedTrials(ROBOT, narrow).hop(POLICY, CommandSchedule(((0.3, 2.0),)), 1)
    assert "faster" in trial.complaint
    assert 0 < trial.seconds < 2.0
    speed = trial.trace.column("knee_velocity_rad_s")
    assert np.abs(speed[:-1]).max() <= 9.0


RULES = StoppingRules(minutes=2.0, tolerance=0.004, margin=0.01, patience=3, gain=0.001, confirm=2)


@pytest.mark.parametrize(
    ("going_on", "ended", "says"),
    [
        (([0.02, 0.003], 0.5), ([0.02, 0.003, 0.004], 0.5), "within 4 mm"),
        (([0.02], 1.75), ([0.02], 1.76), "used up"),
        (([0.02, 0.021, 0.022, 0.015], 1.0), ([0.02, 0.021, 0.0195, 0.023], 1.0), "improved"),
    ],
)
def test_it_stops_when_good_enough_without_time_or_without_gain(going_on, ended, says):
    assert not RULES.reason(*going_on, 0.25)
    assert says in RULES.reason(*ended, 0.25)


def test_only_a_confirmed_decline_is_rolled_back():
    rolled = [RULES.rolled_back([0.01, 0.03, *more]) for more in ([], [0.015], [0.025])]
    assert rolled == [False, False, True]
