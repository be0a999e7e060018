"""The recurrent recipe: its policy file remembers as its student does."""

import numpy as np
import torch

from hopping_leg.controllers.policy import Card, Policy
from hopping_leg.envs.task import HoppingTask
from hopping_leg.rl.onnx_export import build_policy
from tests.rl.learners import ROBOT, TINY_GRU, learner


def test_the_policy_file_acts_as_the_student():
    recipe = TINY_GRU.replace(
        {"task.reset_distribution": "standing", "task.random_episode_start": False}
    )
    model = learner(recipe)
    task: HoppingTask = model.env.task
    network = recipe.actor(model, model.env)
    card = Card(
        "recurrent", recipe.task.observation, *recipe.task.command_bounds,
        recipe.task.action_torque, ROBOT.name, ROBOT.digest, recipe.task.rate,
    )  # fmt: skip
    policy = Policy(build_policy(network, card), "a test", "recurrent")
    for _ in range(2):
        policy.reset(task.count)
        seen = model.env.reset()
        begun = np.ones(task.count, bool)
        model._last_episode_starts = begun
        for _ in range(20):
            with torch.no_grad():
                action = model.policy.student_action(torch.from_numpy(seen)).clamp(-1, 1)
            torque = policy.act(task.measurement)
            np.testing.assert_allclose(
                torque, action.numpy() * recipe.task.action_torque, atol=1e-4
            )
            model.env.step_async(action.numpy())
            seen = model.env.step_wait()[0]
            model._last_episode_starts = ~begun
