"""A student hops while the teacher, who sees the truth, says what it would do."""

import numpy as np
import pytest
import torch

from hopping_leg.controllers.mpc import TrueStateMpc
from hopping_leg.rl.distillation.dagger import DaggerConfig
from hopping_leg.sim import leg_simulator
from tests.rl.learners import ROBOT, STUDENTS, TINY_FAST, learn, learner, policy_file

ROLLOUT = TINY_FAST.algorithm.n_steps * TINY_FAST.schedule.num_envs
FULL = np.array(TINY_FAST.task.action_torque)


class Counting:
    """A teacher whose action is a hundredth of how often it was asked."""

    def __init__(self, count):
        self.count, self.asked = count, 0

    def watch(self, legs):
        pass

    def reset(self, count):
        pass

    def torque(self, command):
        self.asked += 1
        return np.tile((self.asked - 1) / 100 * FULL, (self.count, 1))


class Counted(DaggerConfig):
    def make_teacher(self, task):
        return Counting(task.count)


def counted(**changes):
    config = Counted(**(vars(TINY_FAST.algorithm) | changes))
    return TINY_FAST.replace({"task.episode": 0.1}, algorithm=config)


def trained(recipe, seed, threads=1):
    made = recipe.make_learner(ROBOT, seed, threads)
    return policy_file(recipe, learn(made, recipe.schedule.steps)).content


@pytest.mark.parametrize("name", ["window", "gru"])
def test_the_seed_alone_decides_on_any_number_of_threads(name, monkeypatch):
    monkeypatch.setattr(leg_simulator, "_STEPS_PER_THREAD", 1)
    recipe = STUDENTS[name].replace(steps=6 * ROLLOUT)
    first = trained(recipe, 0)
    torch.rand(10)
    assert trained(recipe, 0, threads=2) == first
    assert trained(recipe, 1) != first


PAPERS = TINY_FAST.replace({"task.observation": "three-samples"})


@pytest.mark.parametrize("recipe", [*STUDENTS.values(), PAPERS], ids=[*STUDENTS, "three samples"])
def test_a_policy_file_acts_on_measurements_as_the_student_did(recipe):
    """Through ends of episodes, after which nothing is remembered; the true state is not asked."""
    changes = {"task.episode": 0.1, "task.random_episode_start": False, "mixing_share": 1e-9}
    recipe = recipe.replace(changes, n_steps=50)
    made = learner(recipe)
    file, task = policy_file(recipe, made), made.task
    asked, measured, step = [], [], task.step
    task.step = lambda action: (
        measured.append(task.measurement), asked.append(np.array(action)), step(action)
    )[2]  # fmt: skip
    made._left = 0.5
    made._collect()
    for tick, (seen, action) in enumerate(zip(measured, asked, strict=True)):
        if tick % 20 == 0:
            file.reset(task.count)
        np.testing.assert_allclose(file.act(seen), action.clip(-1, 1) * FULL, atol=2e-4)
    assert np.ptp(asked) > 0.05


def test_the_teacher_acts_at_first_and_ever_less_until_the_student_is_alone():
    made = learner(counted(mixing_share=0.5))
    shares, taught, step = [], [], made.task.step

    def watched(action):
        taught[-1].append((action == made._label).all(axis=1).mean())
        return step(action)

    made.task.step = watched
    made.on_boundary = lambda: (shares.append(made.share), taught.append([]))
    learn(made, 12 * ROLLOUT)
    assert shares == pytest.approx(np.arange(12) / 12)
    helped = np.array([np.mean(rollout) for rollout in taught])
    np.testing.assert_allclose(helped, np.maximum(0, 1 - 2 * np.array(shares)), atol=0.15)
    assert helped[0] == 1
    assert not helped[6:].any()


def test_a_clock_hastens_the_schedules_and_never_delays_them():
    made, shares = learner(counted()), []
    left = iter([1.0, 0.3, 0.2, 1.0])
    made.remaining = lambda: next(left)
    made.on_boundary = lambda: shares.append(made.share)
    learn(made, 4 * ROLLOUT)
    assert shares == pytest.approx([0.0, 0.7, 0.8, 0.75])


def test_the_label_is_what_mpc_does_in_the_true_state():
    made = learner(TINY_FAST)
    other = TrueStateMpc(ROBOT, TINY_FAST.algorithm.teacher)
    other.watch(made.task.legs)
    other.reset(made.task.count)
    for _ in range(40):
        wanted = (other.torque(made.task.command) / FULL).clip(-1, 1)
        np.testing.assert_allclose(made._label, wanted, atol=1e-6)
        made._step()
    made.task.legs.height += 0.01
    assert not np.allclose(made._teach(), made._label, atol=1e-3)


def test_training_goes_beyond_the_highest_command():
    low, high = TINY_FAST.task.command_range
    made = learner(TINY_FAST.replace({"task.command_resampling_time": (0.02, 0.1)}, headroom=0.05))
    commands = [made.task.command.copy() for _ in range(200) if made._step()]
    assert low <= np.min(commands)
    assert high + 0.03 < np.max(commands) <= high + 0.05


def test_the_student_comes_nearer_to_its_teacher():
    made = learn(learner(TINY_FAST), TINY_FAST.schedule.steps)
    losses = [made._gradient_step() for _ in range(200)]
    assert np.mean(losses[-20:]) < 0.7 * np.mean(losses[:20])
