"""The precise recipe: a teacher on the true state, a student that comes to act like it."""

from unittest.mock import Mock

import numpy as np
import pytest
import torch

from hopping_leg.controllers.shooting import Shooting
from hopping_leg.rl.distillation import distillation
from hopping_leg.rl.distillation.teacher_student import CommandCorrection, shift_to_arrival
from hopping_leg.rl.recipes.precise import LEARNT
from hopping_leg.sim.randomization import WIDE_RANGES
from tests.rl.learners import ROBOT, TINY_LEARNT, TINY_PRECISE, learner

RECIPE = LEARNT.replace(num_envs=8, batch_size=512)
DISTILLATION = LEARNT.distillation
RATE = LEARNT.algorithm.learning_rate
COMMANDS = LEARNT.selection.eval_commands


@pytest.fixture(scope="module")
def model():
    return learner(RECIPE)


@pytest.fixture
def seen(model):
    return torch.as_tensor(model.env.reset())


def test_the_student_depends_on_measurements_alone(model, seen):
    size = model.env.task.observation.size
    other = seen.clone()
    other[:, size:] += 1
    act = model.policy.student_action
    torch.testing.assert_close(act(other), act(seen))
    other[:, 0] += 1
    assert not torch.equal(act(other), act(seen))


def test_the_teacher_sees_the_true_state_and_its_own_last_torque(model, seen):
    policy, task = model.policy, model.env.task
    for _ in range(3):
        model.env.step_async(np.full((8, 2), 0.25, np.float32))
        seen = torch.as_tensor(model.env.step_wait()[0])
    columns = list(policy.mlp_extractor._actor)
    torch.testing.assert_close(
        seen[:, columns[-2:]], torch.as_tensor(task._last, dtype=torch.float32)
    )
    torch.testing.assert_close(seen[:, columns[:-2]], torch.as_tensor(task.privileged()))
    blind = seen.clone()
    blind[:, [c for c in range(task.observation.size) if c not in columns]] += 1
    torch.testing.assert_close(policy.teacher_action(blind), policy.teacher_action(seen))


def test_the_teacher_learns_first_and_guides_the_student_ever_less(model):
    policy = model.policy
    mixing = []
    for share in np.linspace(0, 1, 41):
        RECIPE.anneal(model, model.env, share)
        assert policy.student_learns == (share >= DISTILLATION.teacher_share)
        mixing += [policy.mixing] * int(policy.student_learns)
    assert mixing[0] > 0.8
    assert mixing == sorted(mixing, reverse=True)
    assert mixing[-1] == 0


def test_the_teacher_with_the_best_score_teaches():
    scores = iter([0.03, 0.01, 0.02])
    evaluated = []

    def evaluate_teacher(policy):
        evaluated.append({k: v.clone() for k, v in policy.state_dict().items()})
        return next(scores)

    chooser = learner(TINY_LEARNT)
    chooser._evaluate_teacher = evaluate_teacher
    for share in np.linspace(0, TINY_LEARNT.distillation.teacher_share, 7):
        TINY_LEARNT.anneal(chooser, chooser.env, share)
        with torch.no_grad():
            chooser.policy.action_net.bias += 1.0
    with torch.no_grad():
        chooser.policy.action_net.bias -= 1.0
    assert TINY_LEARNT.extra_results(chooser)["teacher_scores_m"] == [0.03, 0.01, 0.02]
    first, second, third = (one["mlp_extractor.policy_net.0.weight"] for one in evaluated)
    assert not torch.equal(first, second)
    assert not torch.equal(second, third)
    now = chooser.policy.state_dict()
    best = {k: v for k, v in evaluated[1].items() if k != "log_std"}
    assert all(torch.equal(now[name], value) for name, value in best.items())
    TINY_LEARNT.anneal(chooser, chooser.env, 1.0)
    assert len(chooser.teacher_scores) == 3


def test_a_teacher_that_passes_gives_the_time_of_the_next_ones_to_the_policy():
    recipe = TINY_LEARNT.replace(teacher_accept_score=0.01)
    scores = iter([0.03, 0.005])
    chooser = learner(recipe)
    chooser._evaluate_teacher = lambda policy: next(scores)
    until = recipe.distillation.teacher_share * 2 / recipe.distillation.teachers
    for share in (0.0, until / 2, until - 1e-3):
        recipe.anneal(chooser, chooser.env, share)
        assert not chooser.policy.student_learns
    recipe.anneal(chooser, chooser.env, until)
    assert chooser.teacher_scores == [0.03, 0.005]
    assert chooser.policy.student_learns
    assert chooser.policy.mixing == 1.0
    recipe.anneal(chooser, chooser.env, recipe.distillation.teacher_share)
    assert len(chooser.teacher_scores) == 2
    assert chooser.policy.mixing < 1.0


def test_the_policys_rate_falls_from_when_its_teacher_passed():
    scores = [0.03, DISTILLATION.teacher_accept_score]
    until = DISTILLATION.student_from(scores)
    assert until == pytest.approx(DISTILLATION.teacher_share * 2 / DISTILLATION.teachers)
    rates = [DISTILLATION.pace(share, scores, RATE) for share in (until, (1 + until) / 2, 1.0)]
    assert rates[0] == pytest.approx(RATE)
    assert rates[0] > rates[1] > rates[2]
    assert [DISTILLATION.student_progress(share, scores) for share in (until, 1.0)] == [0, 1]


def test_a_single_teacher_is_not_evaluated():
    alone = TINY_LEARNT.replace(teachers=1)
    model = learner(alone)
    for share in (0.0, alone.distillation.teacher_share, 1.0):
        alone.anneal(model, model.env, share)
    assert model.teacher_scores == []
    assert "teacher_scores_m" not in alone.extra_results(model)


def test_the_evaluation_tells_a_teacher_that_does_not_hop():
    policy = learner(RECIPE).policy
    with torch.no_grad():
        for weight in policy.action_net.parameters():
            weight.zero_()
    assert DISTILLATION.evaluate_teacher(policy, ROBOT, RECIPE.task, COMMANDS[:1]) >= 1.0


@pytest.mark.parametrize(
    ("scores", "flight", "worst"),
    [((0.002, 0.01, 0.003), 0.6, 0.01), ((0.003,), 0.5, 0.003), ((0.003,), 0.42, 0.011)],
)
def test_the_evaluation_counts_the_worst_height_and_time_on_the_ground(
    model, monkeypatch, scores, flight, worst
):
    def judged(teacher, robot, commands, rate, threads):
        assert teacher._action_noise == DISTILLATION.teacher_action_noise > 0
        assert (commands[0], commands[-1]) == (min(COMMANDS), max(COMMANDS))
        assert np.diff(commands).max() < 0.011
        return [Mock(score=score, flight_fraction=flight) for score in scores]

    monkeypatch.setattr(distillation, "evaluate_policy", judged)
    monkeypatch.setattr(distillation, "command_score", lambda result: result.score)
    found = DISTILLATION.evaluate_teacher(model.policy, ROBOT, RECIPE.task, COMMANDS)
    assert found == pytest.approx(worst)


def test_imitation_brings_the_student_to_its_teacher_and_leaves_the_teacher_alone():
    student = learner(TINY_LEARNT)
    policy = student.policy
    student.on_boundary = lambda: setattr(policy, "student_learns", True)
    student.learn(128)
    before = {k: v.clone() for k, v in policy.state_dict().items() if "student" not in k}
    buffer = torch.as_tensor(student.rollout_buffer.observations.reshape(-1, policy.features_dim))

    def distance():
        with torch.no_grad():
            gap = policy.student_action(buffer) - policy.teacher_action(buffer)
        return float(gap.square().mean())

    student._current_progress_remaining = 0.5
    first = distance()
    for _ in range(20):
        student.train()
    assert distance() < 0.5 * first
    assert all(torch.equal(v, before[k]) for k, v in policy.state_dict().items() if k in before)


def test_the_papers_observation_can_be_taught_too():
    model = learner(TINY_LEARNT.replace({"task.observation": "three-samples"}))
    model.on_boundary = lambda: setattr(model.policy, "student_learns", True)
    model.learn(128)
    assert model.policy.measured == 15
    assert np.isfinite(model.logger.name_to_value["train/dagger_loss"])


def test_legs_differ_for_the_policy_but_not_for_its_teacher():
    recipe = TINY_LEARNT.replace({"task.randomised": WIDE_RANGES})
    model = learner(recipe)
    apart = []
    for share in (0.0, recipe.distillation.teacher_share):
        recipe.anneal(model, model.env, share)
        legs = model.env.task.legs
        legs.stand(slice(None), [0.7, -1.4], 0.05)
        for _ in range(40):
            legs.step(np.full((4, 2), [1.0, -3.0]))
        apart.append(np.ptp(legs.height))
    assert apart[0] == 0
    assert apart[1] > 1e-3


def test_the_teacher_is_asked_where_a_late_legs_action_arrives():
    ticks, first = 6, 1
    seen = np.zeros((ticks, 3, 2), np.float32)
    seen[..., 0] = seen[..., 1] = np.arange(ticks)[:, None]
    begun = np.zeros((ticks, 3), bool)
    begun[3, 2] = True
    shown, known = shift_to_arrival(seen, begun, np.array([0, 2, 2]), first)
    np.testing.assert_array_equal(shown[..., 0], seen[..., 0])
    np.testing.assert_array_equal(shown[:, 0], seen[:, 0])
    assert known[:, 0].all()
    np.testing.assert_array_equal(known[:, 1], [1, 1, 1, 1, 0, 0])
    np.testing.assert_array_equal(known[:, 2], [1, 0, 0, 1, 0, 0])
    np.testing.assert_array_equal(shown[:, 1, 1][known[:, 1]], [2, 3, 4, 5])


def test_every_stage_of_the_curriculum_learns_from_the_full_rate_down():
    stages = DISTILLATION.stages
    assert [(s.name, s.until) for s in stages] == [
        ("teacher 1", 0.25), ("teacher 2", 0.5), ("student", 1.0),
    ]  # fmt: skip
    assert stages[0].must_score == DISTILLATION.teacher_accept_score
    for begun, stage in zip((0.0, 0.25, 0.5), stages, strict=True):
        assert DISTILLATION.pace(begun + 1e-6, (), RATE) > 0.9 * RATE
        assert DISTILLATION.pace(stage.until - 1e-6, (), RATE) < 0.03 * RATE


def aim():
    return CommandCorrection(offset=0.31, gain=1 / 0.11, knots=8)


def test_without_errors_the_teacher_is_told_the_command():
    told = torch.linspace(-1, 1, 9)
    untouched = aim()
    untouched.correct(np.zeros(0), np.zeros(0), 0.5)
    torch.testing.assert_close(untouched(told), told)


def test_aiming_takes_an_offset_that_depends_on_height_away():
    rng = np.random.default_rng(0)
    corrected = aim()

    def hop(commands):
        told = corrected(torch.from_numpy((commands - 0.31) / 0.11).float()).numpy() * 0.11 + 0.31
        return told - 0.004 - 0.05 * (told - 0.31) + rng.normal(0, 0.005, len(commands))

    for _ in range(200):
        commands = rng.uniform(0.20, 0.42, 400)
        corrected.correct(commands, hop(commands) - commands, 0.1)
    for command in (0.22, 0.31, 0.40):
        many = np.full(4000, command)
        assert np.mean(hop(many)) == pytest.approx(command, abs=0.001)


def test_a_height_where_nobody_hopped_is_left_alone():
    corrected = aim()
    corrected.correct(np.full(50, 0.20), np.full(50, 0.01), 0.5)
    assert corrected.values[0] < 0
    assert not corrected.values[1:].any()


def test_a_rollout_shows_what_shooting_would_do_at_the_corrected_command():
    model = learner(TINY_PRECISE)
    env = model.env
    env.correct = lambda command: command + 0.01
    seen = env.reset()
    other = Shooting(ROBOT)
    other.watch(env.task.legs)
    other.reset(env.num_envs)
    for _ in range(40):
        wanted = other.torque(env.task.command + 0.01) / env.task.options.action_torque
        np.testing.assert_allclose(seen[:, -2:], wanted.clip(-1, 1), atol=1e-6)
        action = np.full((env.num_envs, 2), 0.3, np.float32)
        seen, _, done, _ = env.step(action)
        other.take_applied(action * env.task.options.action_torque)
        other.begin(np.flatnonzero(done))


def test_the_student_acts_from_the_start_and_comes_nearer_to_shooting():
    model = learner(TINY_PRECISE)
    TINY_PRECISE.anneal(model, model.env, 0.0)
    assert model.policy.student_learns
    assert model.policy.mixing == 1.0
    TINY_PRECISE.anneal(model, model.env, 0.5)
    assert model.policy.mixing == 0.0
    assert [stage.name for stage in TINY_PRECISE.distillation.stages] == ["student"]
    observation = torch.from_numpy(model.env.reset())
    torch.testing.assert_close(model.policy.teacher_action(observation), observation[:, -2:])
    model.learn(TINY_PRECISE.schedule.steps)
    losses = [model._dagger_step(model.policy) for _ in range(200)]
    assert np.mean(losses[-20:]) < np.mean(losses[:20])
