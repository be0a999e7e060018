import subprocess
import sys

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode

from hopping_leg import ENV_ID
from hopping_leg.envs import HoppingTask, TaskConfig, paper_reward
from hopping_leg.robot import DEFAULT_ROBOT, load_robot
from hopping_leg.sim import NO_NOISE

SHORT = TaskConfig(episode=0.1)


@pytest.mark.filterwarnings("error")
def test_the_environment_passes_gymnasiums_checker():
    check_env(gymnasium.make(ENV_ID).unwrapped, skip_render_check=True)


def test_a_seed_repeats_an_episode_and_no_seed_does_not():
    env = gymnasium.make(ENV_ID, options=SHORT)
    action = np.array([0.3, -0.2], np.float32)

    def episode(seed):
        observation, _ = env.reset(seed=seed)
        return [observation.tobytes()] + [env.step(action)[0].tobytes() for _ in range(10)]

    assert episode(3) == episode(3)
    assert episode(3) != episode(4)
    assert episode(None) != episode(None)


def test_an_episode_is_truncated_with_its_own_last_height():
    env = gymnasium.make(ENV_ID, options=SHORT)
    env.reset(seed=0)
    steps = [env.step(np.full(2, 0.2, np.float32)) for _ in range(20)]
    assert [s[3] for s in steps] == [False] * 19 + [True]
    assert not any(s[2] for s in steps)
    assert steps[-1][4]["base_height"] != pytest.approx(0.21, abs=1e-6)


def test_rewards_are_explained_in_info():
    env = gymnasium.make(ENV_ID)
    _, info = env.reset(seed=0)
    assert info["base_height"] == pytest.approx(0.21)
    _, reward, _, _, info = env.step(np.zeros(2, np.float32))
    weights = {"energy": 0.5, "height": -2, "jerk": -0.05, "position": -0.02, "velocity": -0.005}
    total = sum(weight * info["reward_terms"][name] for name, weight in weights.items())
    assert reward == pytest.approx(total)


def test_vector_env_is_the_batched_task():
    vector = gymnasium.make_vec(ENV_ID, num_envs=5, options=SHORT, threads=1)
    observation, _ = vector.reset(seed=11)
    robot = load_robot(DEFAULT_ROBOT)
    rng, _ = gymnasium.utils.seeding.np_random(11)
    task = HoppingTask(robot, 5, SHORT, paper_reward(robot), np.random.default_rng(0), 1)
    np.testing.assert_array_equal(observation, task.reseed(rng))
    plan = np.random.default_rng(1).uniform(-1, 1, (45, 5, 2)).astype(np.float32)
    for tick, action in enumerate(plan, 1):
        observation, reward, _, truncated, info = vector.step(action)
        step = task.step(action)
        np.testing.assert_array_equal(observation, step.observation)
        np.testing.assert_array_equal(reward, step.reward)
        assert truncated.all() == (tick % 20 == 0)
        if truncated.any():
            np.testing.assert_array_equal(np.stack(info["final_obs"]), step.final_observation)
            np.testing.assert_array_equal(info["final_info"]["base_height"], step.height)
            assert info["_final_obs"].all()
        else:
            assert "final_obs" not in info


def test_single_and_vector_agree_on_a_motion_without_noise():
    options = TaskConfig(commands=(0.3,), disturbance=NO_NOISE)
    env = gymnasium.make(ENV_ID, options=options)
    vector = gymnasium.make_vec(ENV_ID, num_envs=2, options=options)
    single, _ = env.reset(seed=0)
    many, _ = vector.reset(seed=5)
    np.testing.assert_array_equal(many, [single, single])
    for action in np.random.default_rng(2).uniform(-1, 1, (30, 2)).astype(np.float32):
        one = env.step(action)
        both = vector.step(np.stack([action, action]))
        np.testing.assert_array_equal(both[0], [one[0], one[0]])
        np.testing.assert_allclose(both[1], one[1], rtol=1e-12)


def test_the_observation_is_the_papers_or_a_chosen_one():
    for options, sizes in ((TaskConfig(), {15}), (TaskConfig(observation="dated"), range(16, 99))):
        single = gymnasium.make(ENV_ID, options=options)
        vector = gymnasium.make_vec(ENV_ID, num_envs=3, options=options)
        assert vector.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
        for env in (single, vector):
            observation, _ = env.reset(seed=0)
            assert env.observation_space.contains(observation)
            assert observation.shape[-1] in sizes
        assert single.action_space.shape == (2,)


@pytest.mark.parametrize(
    "words",
    [
        "import gymnasium as g; g.make('HoppingLeg-v0'); g.make('hopping_leg:HoppingLeg-v0')",
        "import hopping_leg, gymnasium; gymnasium.make_vec('HoppingLeg-v0', num_envs=2)",
    ],
)
def test_gymnasium_knows_it_imported_or_not(words):
    subprocess.run([sys.executable, "-W", "error::UserWarning", "-c", words], check=True)


def test_importing_the_package_does_not_import_gymnasium():
    command = [sys.executable, "-c", "import sys, hopping_leg; print(*sys.modules)"]
    loaded = subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()
    assert "hopping_leg" in loaded
    assert not {"gymnasium", "numpy", "mujoco"} & set(loaded)
