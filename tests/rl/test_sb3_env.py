import numpy as np
import pytest
import torch

from hopping_leg.envs import HoppingTask, TaskConfig
from hopping_leg.envs.observation import PRIVILEGED, SIZE
from hopping_leg.rl.resumable import ResumablePPO
from hopping_leg.rl.sb3_env import TaskVecEnv
from hopping_leg.rl.sb3_policies import AsymmetricPolicy
from tests.rl.learners import ROBOT, TINY


def make(privileged=False, episode=0.05, num_envs=3):
    options = TaskConfig(episode=episode)
    rng = np.random.default_rng(0)
    task = HoppingTask(ROBOT, num_envs, options, TINY.make_reward(ROBOT), rng, 1)
    return TaskVecEnv(task, privileged=privileged)


@pytest.mark.parametrize("privileged", [False, True])
def test_an_episode_ends_as_stable_baselines_wants_it(privileged):
    env = make(privileged)
    env.reset()
    total = 0.0
    for tick in range(10):
        observation, reward, done, infos = env.step(np.full((3, 2), 0.5))
        total += reward[0]
        assert done.all() == (tick == 9)
    assert observation.shape == env.observation_space.shape or observation.shape == (
        3,
        *env.observation_space.shape,
    )
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


def test_state_continues_exactly():
    env, other = make(True), make(True)
    env.reset()
    rng = np.random.default_rng(1)
    for _ in range(7):
        env.step(rng.uniform(-1, 1, (3, 2)))
    other.restore(env.state())
    for _ in range(30):
        action = rng.uniform(-1, 1, (3, 2))
        for a, b in zip(env.step(action)[:3], other.step(action)[:3], strict=True):
            np.testing.assert_array_equal(a, b)


def test_asymmetric_actor_ignores_the_true_state_and_the_critic_uses_it():
    model = ResumablePPO(
        AsymmetricPolicy, make(True), n_steps=8, batch_size=8, device="cpu",
        policy_kwargs={"net_arch": {"pi": [8], "vf": [8]}, "actor_size": SIZE},
    )  # fmt: skip
    seen = torch.randn(5, SIZE)
    a, b = (torch.cat([seen, torch.randn(5, PRIVILEGED)], dim=1) for _ in range(2))
    policy = model.policy
    assert torch.equal(
        policy._predict(a, deterministic=True), policy._predict(b, deterministic=True)
    )
    assert not torch.allclose(policy.predict_values(a), policy.predict_values(b))
    network = TINY.actor(model, model.env)
    assert network.layers[0][0].shape == (8, SIZE)
