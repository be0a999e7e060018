"""The teacher of a run as a controller."""

import numpy as np
import pytest
import torch
from tests.rl.learners import ROBOT, learner

from hopping_leg.controllers import RolloutConfig, rollout
from hopping_leg.errors import UsageError
from hopping_leg.rl.checkpoint import write_checkpoint
from hopping_leg.rl.distillation.teacher_student import Teacher
from hopping_leg.rl.recipes import change, get_recipe
from hopping_leg.rl.resumable import learner_state
from hopping_leg.rl.run_folder import RunFolder
from hopping_leg.robot import load_robot
from studies.limits.run import teacher_of_run


def stop_early(folder, name="adaptive"):
    """Leave a run as it is after its first checkpoint; return its model."""
    recipe = change(get_recipe(name), ["num_envs=4"])
    run = RunFolder(folder, recipe, ROBOT, 3, None)
    run.begin(resume=False)
    model = learner(recipe)
    write_checkpoint(run.checkpoints, 0, {"model": learner_state(model)})
    return model


def test_it_acts_as_the_teacher_does_in_training(tmp_path):
    model = stop_early(tmp_path)
    task, teacher = model.env.task, teacher_of_run(tmp_path, ROBOT)
    seen = model.env.reset()
    teacher.watch(task.legs)
    teacher.reset(task.count)
    for _ in range(20):
        with torch.no_grad():
            wanted = model.policy.teacher_action(torch.as_tensor(seen)).numpy()
        torque = teacher.act(task.measurement)
        np.testing.assert_allclose(torque, wanted * task.options.action_torque, atol=1e-5)
        model.env.step_async(wanted)
        seen = model.env.step_wait()[0]
    assert np.abs(torque).max() > 1e-3


def test_a_rollout_shows_it_the_legs(tmp_path):
    stop_early(tmp_path)
    commands = np.full((20, 3), [0.25, 0.3, 0.35])
    setup = RolloutConfig(ROBOT, threads=1)
    teachers = [teacher_of_run(tmp_path, ROBOT) for _ in range(2)]
    first, second = (rollout(teacher, setup, commands, seed=1) for teacher in teachers)
    np.testing.assert_array_equal(first.data["height_m"], second.data["height_m"])
    assert np.ptp(first.data["hip_command_nm"][-1]) > 0


def test_its_digest_tells_other_weights(tmp_path):
    stop_early(tmp_path)
    teacher, other = teacher_of_run(tmp_path, ROBOT), teacher_of_run(tmp_path, ROBOT)
    assert teacher.digest == other.digest
    with torch.no_grad():
        other._policy.action_net.bias += 1e-3
    assert teacher.digest != other.digest


def test_what_has_no_teacher_is_refused(tmp_path):
    with pytest.raises(UsageError, match="no run with a checkpoint"):
        teacher_of_run(tmp_path, ROBOT)
    stop_early(tmp_path / "fast", "fast")
    stop_early(tmp_path / "precise", "precise")
    for name in ("fast", "precise"):
        with pytest.raises(UsageError, match="no teacher"):
            teacher_of_run(tmp_path / name, ROBOT)
    stop_early(tmp_path / "adaptive")
    with pytest.raises(UsageError, match="trained on legv2-paper"):
        teacher_of_run(tmp_path / "adaptive", load_robot("legv2"))


def test_its_torques_can_err_as_an_imitators_do(tmp_path):
    model = stop_early(tmp_path)
    task, recipe = model.env.task, get_recipe("adaptive")
    right, wrong = (
        Teacher(model.policy, ROBOT, recipe.task, teacher_action_noise)
        for teacher_action_noise in (0.0, 0.05)
    )

    def errors():
        model.env.reset()
        for teacher in (right, wrong):
            teacher.watch(task.legs)
            teacher.reset(task.count)
        gaps = []
        for _ in range(400):
            measurement = task.measurement
            gaps.append((wrong.act(measurement) - right.act(measurement)) / 6.0)
            wrong._last = right._last
        return np.array(gaps)

    first = errors()
    np.testing.assert_allclose(first, errors(), atol=1e-12)
    assert first.std() == pytest.approx(0.05, rel=0.15)
    late, early = first[1:].ravel(), first[:-1].ravel()
    assert 0.7 < np.corrcoef(late, early)[0, 1] < 0.9
