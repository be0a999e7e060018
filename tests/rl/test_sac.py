"""Soft actor-critic: what its actor sees, and that its policy is its actor."""

import numpy as np
import pytest
import torch
from stable_baselines3.common.vec_env import VecMonitor

from hopping_leg.envs import HoppingTask, TaskConfig
from hopping_leg.rl.sac import TaskVecEnv
from tests.rl.learners import ROBOT, TINY, learner


def test_the_policy_is_what_the_algorithm_predicts():
    sac = learner(TINY.replace(actor=(32, 32), critic=(32, 32)))
    seen = np.random.default_rng(0).normal(size=(50, *sac.observation_space.shape))
    expected, _ = sac.predict(seen.astype(np.float32), deterministic=True)
    measured = torch.from_numpy(seen[:, : sac.env.task.observation.size]).float()
    with torch.no_grad():
        action, _ = sac.network()(measured, measured[:, :0])
    np.testing.assert_allclose(action, expected, atol=1e-5)
    assert np.ptp(expected) > 0.01


def test_the_actor_sees_measurements_and_the_critics_the_true_state():
    sac = learner(TINY)
    size = sac.env.task.observation.size
    seen = torch.as_tensor(sac.env.reset())
    measured, truth = seen.clone(), seen.clone()
    measured[:, :size] += 1
    truth[:, size:] += 1
    action = torch.zeros(len(seen), 2)

    def said(observation):
        critics = torch.cat(sac.critic(observation, action))
        return sac.actor(observation, deterministic=True), critics

    for changed, sees in ((measured, (True, False)), (truth, (False, True))):
        differ = [not torch.equal(a, b) for a, b in zip(said(changed), said(seen), strict=True)]
        assert tuple(differ) == sees


def make():
    options, rng = TaskConfig(episode=0.05), np.random.default_rng(0)
    task = HoppingTask(ROBOT, 3, options, TINY.make_reward(ROBOT), rng, 1)
    return VecMonitor(TaskVecEnv(task))


def test_an_episode_ends_as_stable_baselines_wants_it():
    env = make()
    env.reset()
    total = 0.0
    for tick in range(10):
        observation, reward, done, infos = env.step(np.full((3, 2), 0.5))
        total += reward[0]
        assert done.all() == (tick == 9)
    assert observation.shape == (3, *env.observation_space.shape)
    assert infos[0]["TimeLimit.truncated"]
    assert infos[0]["episode"]["l"] == 10
    assert infos[0]["episode"]["r"] == pytest.approx(total)
    assert not np.allclose(infos[0]["terminal_observation"], observation[0])
    assert infos[0]["terminal_observation"].shape == env.observation_space.shape
