import numpy as np
import torch

from hopping_leg.controllers.shooting import Shooting
from tests.rl.learners import ROBOT, TINY_SHOOTING, learner


def test_a_rollout_shows_what_shooting_would_do_at_the_corrected_command():
    model = learner(TINY_SHOOTING)
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
    model = learner(TINY_SHOOTING)
    TINY_SHOOTING.anneal(model, model.env, 0.0)
    assert model.policy.student_learns
    assert model.policy.mixing == 1.0
    TINY_SHOOTING.anneal(model, model.env, 0.5)
    assert model.policy.mixing == 0.0
    assert [stage.name for stage in TINY_SHOOTING.distillation.stages] == ["student"]
    observation = torch.from_numpy(model.env.reset())
    torch.testing.assert_close(model.policy.teacher_action(observation), observation[:, -2:])
    model.learn(TINY_SHOOTING.schedule.steps)
    losses = [model._dagger_step(model.policy) for _ in range(200)]
    assert np.mean(losses[-20:]) < np.mean(losses[:20])
