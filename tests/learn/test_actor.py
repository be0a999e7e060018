import dataclasses

import numpy as np
import pytest
import torch

from hopping_leg.control.policy import Card, Policy
from hopping_leg.learn.export import build_policy
from hopping_leg.sim.disturbance import Measurement
from tests.learn.learners import ROBOT, TINY, TinyPPO, learner


def measurement(count):
    rng = np.random.default_rng(0)
    return Measurement(
        rng.uniform(-3, 3, (count, 3, 2)),
        rng.uniform(-20, 20, (count, 3, 2)),
        rng.uniform(0.25, 0.35, (count, 3)),
        np.zeros((count, 3)),
    )


@pytest.mark.parametrize("recipe", [TINY, TinyPPO()], ids=["sac", "ppo"])
def test_policy_file_gives_the_actors_torques(recipe):
    recipe = dataclasses.replace(recipe, hidden=(32, 32))
    model = learner(recipe)
    with torch.no_grad():
        for parameter in model.policy.parameters():
            parameter.mul_(40.0 if recipe is not TINY else 4.0)
    env = model.env
    scale = recipe.task.action_torque
    card = Card("test", recipe.layout, 0.25, 0.35, scale, ROBOT.name, ROBOT.digest, 200.0)
    policy = Policy(build_policy(recipe.network(model, env), card), "memory", "test")
    policy.reset(50)
    m = measurement(50)
    expected, _ = model.predict(env.task.scaling.observe(m), deterministic=True)
    action = policy.act(m) / scale
    np.testing.assert_allclose(action, expected, atol=1e-5)
    assert np.abs(action).max() > 0.2
