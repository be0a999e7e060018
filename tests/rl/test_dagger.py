"""A student hops while the teacher, who sees the truth, says what it would do."""

from pathlib import Path

import numpy as np
import onnx
import pytest
import torch

from hopping_leg.envs.hidden_state import OF_MOTION
from hopping_leg.rl.dagger import DaggerConfig
from hopping_leg.rl.recipes import RECIPES
from hopping_leg.sim import Measurement, leg_simulator
from tests.rl.learners import (
    ROBOT,
    STUDENTS,
    TINY_FAST,
    TINY_UNIVERSAL,
    learn,
    learner,
    policy_file,
    some_legs,
)

ROLLOUT = TINY_FAST.algorithm.n_steps * TINY_FAST.schedule.num_envs
FULL = np.array(TINY_FAST.task.action_torque)


class Counting:
    """A teacher whose action is a hundredth of how often it was asked."""

    def __init__(self, count):
        self.count, self.asked = count, 0

    @property
    def pushing(self):
        return np.zeros(self.count, bool)

    folding = pushing

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
    legs = some_legs() if recipe.legs == "any" else ()
    made = recipe.make_learner(ROBOT, seed, threads, legs)
    return policy_file(recipe, learn(made, recipe.schedule.steps)).content


EVERY = {**STUDENTS, "universal": TINY_UNIVERSAL.replace(n_steps=16)}


@pytest.mark.parametrize("name", ["window", "gru", "universal"])
def test_the_seed_alone_decides_on_any_number_of_threads(name, monkeypatch):
    monkeypatch.setattr(leg_simulator, "_STEPS_PER_THREAD", 1)
    recipe = EVERY[name].replace(steps=6 * ROLLOUT)
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
    made.collectors.call("collect", made._actor, 0.5)
    for tick, (seen, action) in enumerate(zip(measured, asked, strict=True)):
        if tick % 20 == 0:
            file.reset(task.count)
        np.testing.assert_allclose(file.act(seen), action.clip(-1, 1) * FULL, atol=2e-4)
    assert np.ptp(asked) > 0.05


def test_the_teacher_acts_at_first_and_ever_less_until_the_student_is_alone():
    made = learner(counted(mixing_share=0.5))
    shares, taught, step, (collector,) = [], [], made.task.step, made.collectors.here

    def watched(action):
        taught[-1].append((action == collector._label).all(axis=1).mean())
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
    (made,) = learner(TINY_FAST).collectors.here
    other = TINY_FAST.algorithm.make_teacher(made.task)
    other.watch(made.task.legs)
    other.reset(made.task.count)
    for _ in range(40):
        wanted = (other.torque(made.task.command) / FULL).clip(-1, 1)
        np.testing.assert_allclose(made._label, wanted, atol=1e-6)
        made._step(lambda seen, memory: (torch.zeros(len(seen), 2), memory), 0.5)
    made.task.legs.height += 0.01
    assert not np.allclose(made._teach(), made._label, atol=1e-3)


def test_training_goes_beyond_the_highest_command():
    low, high = TINY_FAST.task.command_range
    recipe = TINY_FAST.replace({"task.command_resampling_time": (0.02, 0.1)}, headroom=0.05)
    task, commands = learner(recipe).task, []
    for _ in range(200):
        task.step(np.zeros((4, 2)))
        commands.append(task.command.copy())
    assert low <= np.min(commands)
    assert high + 0.03 < np.max(commands) <= high + 0.05


def test_a_policy_for_any_leg_acts_on_each_as_the_student_did():
    """In torques of the leg's size, told what is believed of it, its command corrected."""
    recipe = TINY_UNIVERSAL.replace(correction=0.2)
    made = learn(learner(recipe), 3 * recipe.algorithm.n_steps * 4)
    task, student = made.task, made.student
    files = []
    for leg in task.task_legs:
        files.append(policy_file(recipe, made))
        files[-1].set_robot(leg.believed)
        files[-1].reset(1)
    seen, memory = task.reset(), torch.zeros(4, student.memory_size)
    for _ in range(60):
        with torch.no_grad():
            action, memory = student(torch.from_numpy(seen), memory)
        m = task.measurement
        for row, file in enumerate(files):
            one = Measurement(*(part[row : row + 1] for part in (m.q, m.qd, m.command, m.age)))
            wanted = action[row].clip(-1, 1).numpy() * task.full_torque[row]
            np.testing.assert_allclose(file.act(one)[0], wanted, atol=2e-3)
        seen = task.step(action.numpy()).observation
    assert np.ptp(memory[:, -1].numpy()) > 1e-3, "commands are corrected, each leg's by its own"


def test_the_small_policy_fits_60_kb_at_8_bits_and_the_browser_runs_it():
    made = learner(recipe := TINY_UNIVERSAL.replace(network=RECIPES["universal-small"].network))
    assert sum(values.numel() for values in made.student.parameters()) < 50_000
    graph = onnx.load_from_string(policy_file(recipe, made).content).graph
    page = (Path(__file__).parents[2] / "docs/live/onnx.js").read_text()
    assert all(f"\n  {node.op_type}" in page for node in graph.node)


def test_a_push_counts_more_and_what_is_hidden_is_guessed():
    made = learn(learner(TINY_UNIVERSAL.replace(buffer_size=4096)), 16 * 32 * 6)
    state = {k: np.asarray(v) for k, v in made._buffer.state().items()}
    config = TINY_UNIVERSAL.algorithm
    assert set(np.unique(state["weights"])) == {1.0, config.push_weight, config.fold_weight}
    hidden = state["hidden"].reshape(-1, made.collectors.here[0].hidden.size)
    batch, _, guesses = made.student.recall(made._buffer, 64, made._draws)
    assert guesses.shape == batch.hidden.shape
    assert (hidden[:, :OF_MOTION].std(axis=0) > 0).all()
    assert (hidden[:, OF_MOTION:].std(axis=0) > 0).any()


def test_some_bases_are_pushed_for_single_control_periods_unseen_by_the_teacher():
    recipe = TINY_FAST.replace(num_envs=128, impulse=0.5, buffer_size=128 * 16)
    learning = learner(recipe.replace(n_steps=200))
    (made,) = learning.collectors.here
    legs, teach, forces = made.task.legs, made._teach, []
    made._teach = lambda: (np.testing.assert_equal(legs._push, 0.0), teach())[1]
    push = legs.push
    legs.push = lambda force: (forces.append(force.copy()), push(force))
    made.collect(learning._actor, 0.5)
    pushed = np.array(forces[::2])
    impulses, often = pushed / made.task.options.rate, (pushed != 0).mean(axis=0)
    most = 0.5 * ROBOT.mass * np.sqrt(9.81 * (ROBOT.thigh.length + ROBOT.shank.length))
    assert 0.7 * most < np.abs(impulses).max() <= 1.01 * most
    assert impulses.min() < 0 < impulses.max()
    assert 0 < (often > 0).mean() < 0.6
    assert often.max() < 0.04


def test_the_student_comes_nearer_to_its_teacher():
    made = learn(learner(TINY_FAST), TINY_FAST.schedule.steps)
    losses = [made._gradient_step() for _ in range(200)]
    assert np.mean(losses[-20:]) < 0.7 * np.mean(losses[:20])
