import numpy as np
import pytest
import torch

from hopping_leg.controllers.policy import Card, Policy
from hopping_leg.envs.observation import PaperObservation, sample_scaling
from hopping_leg.rl.onnx_export import build_policy
from hopping_leg.sim.channel import Measurement
from tests.rl.learners import ROBOT, TINY, TINY_FAST, TINY_PPO, learner


def measurement(count):
    rng = np.random.default_rng(0)
    return Measurement(
        rng.uniform(-3, 3, (count, 3, 2)),
        rng.uniform(-20, 20, (count, 3, 2)),
        rng.uniform(0.25, 0.35, (count, 3)),
        np.zeros((count, 3)),
    )


@pytest.mark.parametrize("recipe", [TINY, TINY_PPO], ids=["sac", "ppo"])
def test_policy_file_gives_the_actors_torques(recipe):
    recipe = recipe.replace(actor=(32, 32), critic=(32, 32), privileged_critic=False)
    model = learner(recipe)
    with torch.no_grad():
        for parameter in model.policy.parameters():
            parameter.mul_(40.0 if recipe is not TINY else 4.0)
    env = model.env
    scale = recipe.task.action_torque
    card = Card("test", recipe.task.observation, 0.25, 0.35, scale, ROBOT.name, ROBOT.digest, 200.0)
    policy = Policy(build_policy(recipe.actor(model, env), card), "memory", "test")
    policy.reset(50)
    m = measurement(50)
    samples = np.concatenate([m.q, m.qd, m.command[..., None]], axis=-1)
    seen = PaperObservation(sample_scaling(ROBOT, recipe.task), 50).view(samples)
    expected, _ = model.predict(seen, deterministic=True)
    action = policy.act(m) / scale
    np.testing.assert_allclose(action, expected, atol=1e-5)
    assert np.abs(action).max() > 0.2


def test_a_dated_policy_file_sees_what_its_task_shows():
    """Run beside the task on the same measurements, the file gives the actor's torques."""
    recipe = TINY_FAST.replace({"task.episode": 100.0})
    model = learner(recipe)
    task, scale = model.env.task, recipe.task.action_torque
    card = Card("test", "dated", 0.22, 0.4, scale, ROBOT.name, ROBOT.digest, 200.0)
    policy = Policy(build_policy(recipe.actor(model, model.env), card), "memory", "test")
    seen = model.env.reset()
    policy.reset(task.count)
    for _ in range(30):
        expected, _ = model.predict(seen, deterministic=True)
        np.testing.assert_allclose(policy.act(task.measurement) / scale, expected, atol=1e-5)
        model.env.step_async(expected)
        seen, *_ = model.env.step_wait()
