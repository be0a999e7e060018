"""PPO: what it learns from and towards, reproducibly; its policy file is its actor."""

import numpy as np
import pytest
import torch

from hopping_leg.envs import RewardTerm
from hopping_leg.sim import leg_simulator
from tests.rl.learners import ROBOT, TINY_RL, learn, learner, policy_file


def long_way_advantages(rollout, values, final, config):
    """Sum discounted errors tick by tick, (ticks, n); ends of episodes in their order."""
    ticks, count = rollout.rewards.shape
    errors, ends = np.zeros((ticks, count)), iter(final)
    for tick in range(ticks):
        for leg in range(count):
            after = values[tick + 1, leg]
            if rollout.ended[tick, leg]:
                after = next(ends)
            errors[tick, leg] = rollout.rewards[tick, leg] + config.gamma * after
    errors -= values[:-1]
    found = np.zeros((ticks, count))
    for tick, leg in np.ndindex(ticks, count):
        factor = 1.0
        for later in range(tick, ticks):
            found[tick, leg] += factor * errors[later, leg]
            factor *= config.gamma * config.gae_lambda
            if rollout.ended[later, leg]:
                break
    return found


@pytest.mark.parametrize("workers", [1, 2])
def test_advantages_end_with_episodes_and_know_what_time_cut_off(workers):
    recipe = TINY_RL.replace({"task.episode": 0.05, "task.fall_clearance": 0.08}, n_steps=40)
    made = learner(recipe.replace(workers=workers))
    rollout = made._collect()
    ends = rollout.ended > 0
    cut = rollout.truncated[ends].numpy().astype(bool)
    assert rollout.truncated.sum() == cut.sum() > 0
    assert len(cut) > 4
    assert not cut.all()
    with torch.no_grad():
        values = made.critic(rollout.states)[..., 0].numpy()
        final = made.critic(rollout.final[ends])[:, 0].numpy() * cut
    advantages, returns = made._advantages(rollout)
    expected = long_way_advantages(rollout, values, final, recipe.algorithm)
    np.testing.assert_allclose(advantages, expected, atol=1e-5)
    np.testing.assert_allclose(returns, expected + values[:-1], atol=1e-5)


def test_it_learns_what_its_reward_pays():
    def paid(transition):
        return -np.square(transition.action - [0.5, -0.3]).sum(axis=1)

    recipe = TINY_RL.replace(
        {"reward": None}, reward_terms=(RewardTerm("paid", 1.0, paid),), num_envs=64, n_steps=16,
        batch_size=256, learning_rate=3e-3, gamma=0.0,
    )  # fmt: skip
    made = learn(learner(recipe), 64 * 16 * 40)
    rollout = made._collect()
    mean = made.actor(rollout.observations).mean(dim=(0, 1)).detach()
    np.testing.assert_allclose(mean, [0.5, -0.3], atol=0.05)
    assert float(rollout.std) == pytest.approx(np.exp(recipe.algorithm.log_std[1]))


def test_the_seed_alone_decides_on_any_number_of_threads(monkeypatch):
    monkeypatch.setattr(leg_simulator, "_STEPS_PER_THREAD", 1)

    def trained(seed, threads):
        made = learn(TINY_RL.make_learner(ROBOT, seed, threads), TINY_RL.schedule.steps)
        return policy_file(TINY_RL, made).content

    first = trained(0, 1)
    torch.rand(10)
    assert trained(0, 2) == first
    assert trained(1, 1) != first


def test_the_policy_is_the_mean_of_the_actors_so_far():
    made, means = learner(TINY_RL), []
    for _ in range(2):
        means.append([p.detach().numpy().copy() for p in made.network().parameters()])
        made._train(made._collect())
    now = [p.detach().numpy() for p in made.actor.parameters()]
    for first, last, actor in zip(means[1], made.network().parameters(), now, strict=True):
        np.testing.assert_allclose(last.detach(), 0.97 * first + 0.03 * actor, atol=1e-6)
        assert not np.allclose(first, actor, atol=1e-6)
