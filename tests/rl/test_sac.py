"""Soft actor-critic: what its actor sees, and that a policy file is its actor."""

import numpy as np
import pytest
import torch
from stable_baselines3.common.vec_env import VecMonitor

from hopping_leg.envs import HoppingTask, TaskConfig
from hopping_leg.envs.observation import Observation, sample_scaling
from hopping_leg.rl.sac import TaskVecEnv
from hopping_leg.sim.channel import Measurement
from tests.rl.learners import ROBOT, TINY, learner, policy_file


def measurement(count):
    rng = np.random.default_rng(0)
    return Measurement(
        rng.uniform(-3, 3, (count, 3, 2)),
        rng.uniform(-20, 20, (count, 3, 2)),
        rng.uniform(0.25, 0.35, (count, 3)),
        np.zeros((count, 3)),
    )


def test_policy_file_gives_the_actors_torques():
    recipe = TINY.replace(actor=(32, 32), critic=(32, 32))
    sac = learner(recipe)
    with torch.no_grad():
        for parameter in sac.policy.parameters():
            parameter.mul_(4.0)
    policy = policy_file(recipe, sac)
    policy.reset(50)
    m = measurement(50)
    samples = np.concatenate([m.q, m.qd, m.command[..., None]], axis=-1)
    seen = Observation(sample_scaling(ROBOT, recipe.task)).view(samples)
    truth = np.zeros((50, sac.observation_space.shape[0] - seen.shape[1]), np.float32)
    expected, _ = sac.predict(np.concatenate([seen, truth], axis=1), deterministic=True)
    action = policy.act(m) / recipe.task.action_torque
    np.testing.assert_allclose(action, expected, atol=1e-5)
    assert np.abs(action).max() > 0.2


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
