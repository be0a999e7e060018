"""Trials, learning and stopping as a whole, on a robot that is made up or simulated."""

import dataclasses
import json

import numpy as np
import onnx
import pytest
from onnx import numpy_helper

from hopping_leg.controllers.command_schedule import CommandSchedule
from hopping_leg.controllers.policy import Policy
from hopping_leg.errors import UsageError
from hopping_leg.rl.finetune import apex_estimate, finetuning
from hopping_leg.rl.finetune.apex_estimate import prepare
from hopping_leg.rl.finetune.finetuning import POLICY as FILE
from hopping_leg.rl.finetune.finetuning import StoppingRules, Task, finetune
from hopping_leg.rl.finetune.simulated import Guard, SimulatedTrials
from hopping_leg.robot import load_robot
from tests.rl.learners import TINY_UNIVERSAL, learner, policy_file

from .trials import OPTIONS, POLICY, ROBOT, Imagined

TASK = Task(POLICY, ROBOT, 3)


@pytest.fixture(scope="module")
def ready(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pretraining")
    prepare(POLICY, ROBOT, OPTIONS.contact, folder)
    return folder


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


def test_a_killed_run_goes_on_exactly(tmp_path, ready):
    whole = finetune(TASK, Imagined(), OPTIONS, tmp_path / "whole", pretraining=ready)
    assert len(whole["trials"]) == 6
    for number in (1, 3):

        def kill(row, at=number):
            if row["trial"] == at:
                raise KilledError

        with pytest.raises(KilledError):
            finetune(TASK, Imagined(), OPTIONS, tmp_path / "cut", resume=number > 1,
                  pretraining=ready, on_trial=kill)  # fmt: skip
    cut = finetune(TASK, Imagined(), OPTIONS, tmp_path / "cut", resume=True, pretraining=ready)
    assert cut["trials"] == whole["trials"]
    assert (tmp_path / "cut" / FILE).read_bytes() == (tmp_path / "whole" / FILE).read_bytes()


class Aimed(Imagined):
    """A robot that hops so much beyond what its policy's graph is told; heights are known."""

    def __init__(self, off):
        super().__init__(off)
        self.told = []

    def hop(self, controller, schedule, seed):
        trial = super().hop(controller, schedule, seed)
        model = onnx.load_from_string(controller.content)
        shifts = {w.name: numpy_helper.to_array(w) for w in model.graph.initializer}
        newest = max(name for name in shifts if name.startswith("map_") and "first" in name)
        self.told.append(shifts[newest].item())
        truth = np.add(trial.truth, [0, 0, self.told[-1]])
        return dataclasses.replace(trial, truth=truth)


@pytest.mark.parametrize("off", [0.02, -0.015])
def test_what_hops_miss_is_corrected_trial_by_trial(off, tmp_path, ready, monkeypatch):
    robot = Aimed(off)
    monkeypatch.setattr(finetuning, "estimated", lambda trial, _: trial.truth)
    result = finetune(TASK, robot, OPTIONS, tmp_path, pretraining=ready)
    errors = [row["true_error_m"] for row in result["trials"]]
    assert errors[0] == pytest.approx(abs(off))
    assert errors[1] == pytest.approx(0.4 * abs(off), rel=1e-4)
    assert "within 4 mm" in result["why_it_ended"]
    assert result["best_trial"]["shifts_m"] == pytest.approx([robot.told[-1]] * 2)
    card = Policy((tmp_path / FILE).read_bytes(), "continued", "test").card
    assert POLICY.digest in card.recipe
    assert card.robot_digest == POLICY.card.robot_digest


def test_trials_that_were_ended_early_never_win_and_are_counted(tmp_path, ready):
    result = finetune(TASK, Imagined(complain_from=1), OPTIONS, tmp_path, pretraining=ready)
    rows = result["trials"]
    assert result["safety"]["ended_early"] == result["safety"]["rolled_back"] == len(rows) - 1
    assert result["best_trial"]["trial"] == 0
    assert all(row["next_shifts_m"] == rows[0]["shifts_m"] for row in rows[1:])


def test_what_became_worse_is_rolled_back(tmp_path, ready, monkeypatch):
    off = iter([0.01, 0.05, 0.05, 0.01, 0.01, 0.01])

    def estimated(trial, _):
        return np.add(trial.truth, [0, 0, next(off)])

    monkeypatch.setattr(finetuning, "estimated", estimated)
    rules = StoppingRules(minutes=0.4, margin=0.01, patience=50, tolerance=0.0)
    options = dataclasses.replace(OPTIONS, stopping_rules=rules)
    rows = finetune(TASK, Imagined(0.0), options, tmp_path, pretraining=ready)["trials"]
    assert [row["rolled_back"] for row in rows] == [False, False, True, False, False, False]
    assert rows[3]["shifts_m"] == rows[0]["shifts_m"]


def test_a_folder_with_another_run_is_refused(tmp_path, ready):
    finetune(TASK, Imagined(), OPTIONS, tmp_path, pretraining=ready)
    with pytest.raises(UsageError, match="--resume"):
        finetune(TASK, Imagined(), OPTIONS, tmp_path, pretraining=ready)
    with pytest.raises(UsageError, match="another seed"):
        finetune(dataclasses.replace(TASK, seed=4), Imagined(), OPTIONS, tmp_path, resume=True)
    with pytest.raises(UsageError, match="finished"):
        finetune(TASK, Imagined(), OPTIONS, tmp_path, resume=True)
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


def test_a_policy_for_any_leg_is_refused_it_corrects_itself(tmp_path):
    made = policy_file(TINY_UNIVERSAL, learner(TINY_UNIVERSAL))
    with pytest.raises(UsageError, match="corrects its command itself"):
        finetune(Task(made, ROBOT, 0), Imagined(), OPTIONS, tmp_path)
