"""The fast recipe: the actor never sees the true state, annealing depends on progress alone."""

import numpy as np
import pytest
import torch

from hopping_leg.rl.recipes.fast import FAST
from hopping_leg.robot import load_robot


@pytest.fixture(scope="module")
def learner():
    recipe = FAST.replace(num_envs=8, batch_size=256)
    env = recipe.make_env(load_robot("legv2-paper"), seed=3)
    return recipe, env, recipe.make_model(env, seed=3)


def test_actions_depend_on_measurements_alone(learner):
    _, env, model = learner
    size = env.task.observation.size
    observation = env.reset()
    action, _ = model.predict(observation, deterministic=True)
    blind, other = observation.copy(), observation.copy()
    blind[:, size:] += 100
    other[:, :size] += 0.1
    np.testing.assert_array_equal(model.predict(blind, deterministic=True)[0], action)
    assert not np.array_equal(model.predict(other, deterministic=True)[0], action)


def test_values_depend_on_the_true_state_alone(learner):
    _, env, model = learner
    size = env.task.observation.size
    observation = torch.as_tensor(env.reset())
    blind = observation.clone()
    blind[:, :size] += 1
    value = model.policy.predict_values(observation)
    torch.testing.assert_close(model.policy.predict_values(blind), value)
    blind[:, size:] += 1
    assert not torch.allclose(model.policy.predict_values(blind), value)


def test_annealing_depends_on_progress_alone(learner):
    recipe, env, model = learner
    recipe.anneal(model, env, 0.5)
    half = model.policy.log_std.detach().clone()
    recipe.anneal(model, env, 1.0)
    assert model.policy.log_std.max().item() == pytest.approx(recipe.algorithm.log_std[1])
    recipe.anneal(model, env, 0.5)
    torch.testing.assert_close(model.policy.log_std.detach(), half)


def test_hop_starts_lie_near_the_commanded_apex(learner):
    _, env, _ = learner
    task = env.task
    flying = task.legs.foot_clearance() > 1e-6
    error = task.legs.height[flying] - task.command[flying]
    assert flying.any()
    assert np.all((error > -0.07) & (error < 0.04))
