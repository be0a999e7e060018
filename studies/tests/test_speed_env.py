import numpy as np
import pytest

from hopping_leg.envs import HoppingTask, TaskConfig, paper_reward
from hopping_leg.robot import load_robot
from studies.shared import interleave
from studies.speed.env import Env, bench_env, record

ROBOT = load_robot("legv2-paper")


def test_rounds_alternate_and_the_cold_one_is_left_out():
    calls = []
    taken = interleave({"a": lambda: calls.append("a"), "b": lambda: calls.append("b")}, 3)
    assert "".join(calls) == "abababab"
    assert {name: len(values) for name, values in taken.items()} == {"a": 3, "b": 3}


def test_the_recorded_motion_repeats():
    options = TaskConfig(action_torque=(10, 20), episode=3600)
    rng = np.random.default_rng(0)
    task = HoppingTask(ROBOT, 3, options, paper_reward(ROBOT), rng, 1)
    motion = record(task, 100)
    end = task.legs.state.copy()
    assert end[:, 0].max() > 0.15
    task.restore(motion.start)
    for action in motion.actions:
        task.step(action)
    np.testing.assert_array_equal(task.legs.state, end)


def test_every_promised_number_is_there():
    pytest.importorskip("imageio")
    result = bench_env(Env(count=8, ticks=5, single_ticks=5, repeats=2, threads=1))
    names = {
        "batched_env_steps_per_s",
        "single_env_step_s",
        "stepper_step_s",
        "mujoco_batch_step_s",
        "stepper_over_mujoco",
        "stepper_with_effects_over_mujoco",
    }
    assert names <= result.keys()
    assert all(result[name] > 0 for name in names)
    assert result["setup"]["substeps"] == 10
