from functools import partial

import numpy as np
import pytest
import torch

from hopping_leg.envs import HoppingTask, TaskConfig
from hopping_leg.envs.observation import PaperObservation, sample_scaling
from hopping_leg.rl.sb3_env import TaskVecEnv
from hopping_leg.sim.channel import Measurement
from tests.rl.learners import EVERY, ROBOT, TINY, learner, policy_file


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
