import numpy as np
import pytest

from hopping_leg.envs import HoppingTask, TaskConfig, paper_reward
from hopping_leg.robot import load_robot
from hopping_leg.sim import MujocoSimulator
from studies.shared import interleave
from studies.speed.env import EnvBenchmark, bench_env, record

ROBOT = load_robot("legv2-paper")


def test_rounds_alternate_and_the_cold_one_is_left_out():
    calls = []
    taken = interleave({"a": lambda: calls.append("a"), "b": lambda: calls.append("b")}, 3)
    assert "".join(calls) == "abababab"
    assert {name: len(values) for name, values in taken.items()} == {"a": 3, "b": 3}


def test_bare_physics_repeats_the_very_same_motion():
    options = TaskConfig(action_torque=(10, 20), episode=3600)
    rng = np.random.default_rng(0)
    task = HoppingTask(ROBOT, 3, options, paper_reward(ROBOT), rng, 1)
    motion = record(task, 100)
    end = task.legs.state.copy()
    assert end[:, 0].max() > 0.15
    bare = MujocoSimulator(ROBOT, 3, threads=1)
    bare.batch.state[:] = motion.start["physics"]
    for controls in motion.controls:
        bare.batch.ctrl = controls
        bare.batch.step(nstep=bare.substeps)
    np.testing.assert_array_equal(bare.state, end)
    task.restore(motion.start)
    for action in motion.actions:
        task.step(action)
    np.testing.assert_array_equal(task.legs.state, end)


def test_every_promised_number_is_there():
    pytest.importorskip("imageio")
    tiny = EnvBenchmark(ROBOT, count=8, ticks=5, single_ticks=5, repeats=2, threads=1)
    result = bench_env(tiny)
    names = {
        "batched_env_steps_per_s",
        "batched_env_over_bare_physics",
        "single_env_cost_over_bare_physics",
        "single_env_over_hopper_v5",
        "batched_env_over_hopper_v5",
    }
    assert names <= result.keys()
    assert all(result[name] > 0 for name in names)
    assert result["setup"]["substeps"] == 10
