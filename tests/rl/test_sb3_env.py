"""The task as stable-baselines3 wants it."""

import numpy as np
import pytest
from stable_baselines3.common.vec_env import VecMonitor

from hopping_leg.envs import HoppingTask, TaskConfig
from hopping_leg.rl.sb3_env import TaskVecEnv
from tests.rl.learners import ROBOT, TINY


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


def test_terms_of_the_reward_are_means_since_they_were_last_taken():
    env, task = make(), make().task
    env.reset()
    task.reset()
    assert env.take_reward_terms() == {}
    for ticks in (4, 2):
        expected = np.mean([task.step(np.full((3, 2), 0.5)).terms for _ in range(ticks)], (0, 1))
        for _ in range(ticks):
            env.step(np.full((3, 2), 0.5))
        assert list(env.take_reward_terms().values()) == pytest.approx(expected.tolist())
