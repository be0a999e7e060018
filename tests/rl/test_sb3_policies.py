from functools import partial

import numpy as np
import pytest
import torch

from hopping_leg.envs.observation import PaperObservation, sample_scaling
from hopping_leg.sim.channel import Measurement
from tests.rl.learners import EVERY, ROBOT, learner, policy_file


def measurement(count):
    rng = np.random.default_rng(0)
    return Measurement(
        rng.uniform(-3, 3, (count, 3, 2)),
        rng.uniform(-20, 20, (count, 3, 2)),
        rng.uniform(0.25, 0.35, (count, 3)),
        np.zeros((count, 3)),
    )


@pytest.mark.parametrize(("name", "factor"), [("sac", 4.0), ("ppo", 40.0)])
def test_policy_file_gives_the_actors_torques(name, factor):
    recipe = EVERY[name].replace(actor=(32, 32), critic=(32, 32), privileged_critic=False)
    model = learner(recipe)
    with torch.no_grad():
        for parameter in model.policy.parameters():
            parameter.mul_(factor)
    policy = policy_file(recipe, model)
    policy.reset(50)
    m = measurement(50)
    samples = np.concatenate([m.q, m.qd, m.command[..., None]], axis=-1)
    seen = PaperObservation(sample_scaling(ROBOT, recipe.task)).view(samples)
    expected, _ = model.predict(seen, deterministic=True)
    action = policy.act(m) / recipe.task.action_torque
    np.testing.assert_allclose(action, expected, atol=1e-5)
    assert np.abs(action).max() > 0.2


@pytest.mark.parametrize("name", ["fast", "precise", "recurrent", "adaptive"])
def test_a_policy_file_acts_beside_the_task_as_the_actor_and_remembers_the_same(name):
    """In two episodes on the same measurements; adaptive aims as its student does."""
    changes = {"task.reset_distribution": "standing", "task.random_episode_start": False}
    if name == "adaptive":
        changes |= {"integrator.start": 0.0, "integrator.share": 5.0}
    recipe = EVERY[name].replace(changes)
    model = learner(recipe)
    task, actor, file = model.env.task, model.policy, policy_file(recipe, model)
    student = getattr(actor, "student", None)
    if student:
        student.estimate_share = 1.0
    act = actor.student_action if student else partial(actor._predict, deterministic=True)
    for _ in range(2):
        file.reset(task.count)
        seen, begun = model.env.reset(), np.ones(task.count, bool)
        for _ in range(40):
            model._last_episode_starts = begun
            with torch.no_grad():
                action = act(torch.from_numpy(seen)).clamp(-1, 1).numpy()
            torque = file.act(task.measurement)
            np.testing.assert_allclose(torque, action * recipe.task.action_torque, atol=1e-4)
            if file.remembers:
                np.testing.assert_allclose(file._memory, student._memory.numpy(), atol=1e-5)
            model.env.step_async(action)
            seen, begun = model.env.step_wait()[0], np.zeros(task.count, bool)
        assert not file.remembers or np.abs(file._memory).min() > 1e-4
