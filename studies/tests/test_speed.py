import json

import numpy as np
import polars as pl
import pytest

from hopping_leg.deploy.motion_sequence import Part
from hopping_leg.envs import HoppingTask, TaskConfig, paper_reward
from hopping_leg.robot import load_robot
from hopping_leg.trace import Trace
from studies.shared import interleave, main
from studies.speed.deploy import Deploy, settled_apexes
from studies.speed.env import Env, record


def measured(tmp_path, options, *words):
    """Return the numbers that a part of the study writes."""
    file = tmp_path / "speed.json"
    assert main("speed", options, [*words, "--json", str(file)]) == 0
    return json.loads(file.read_text())


def test_rounds_alternate_and_the_cold_one_is_left_out():
    calls = []
    taken = interleave({"a": lambda: calls.append("a"), "b": lambda: calls.append("b")}, 3)
    assert "".join(calls) == "abababab"
    assert {name: len(values) for name, values in taken.items()} == {"a": 3, "b": 3}


def test_the_recorded_motion_repeats():
    options = TaskConfig(action_torque=(10, 20), episode=3600)
    rng = np.random.default_rng(0)
    robot = load_robot("legv2-paper")
    task = HoppingTask(robot, 3, options, paper_reward(robot), rng, 1)
    motion = record(task, 100)
    end = task.legs.state.copy()
    assert end[:, 0].max() > 0.15
    task.restore(motion.start)
    for action in motion.actions:
        task.step(action)
    np.testing.assert_array_equal(task.legs.state, end)


def test_every_promised_number_of_the_environment_is_there(tmp_path):
    pytest.importorskip("imageio")
    words = ["--count", "8", "--ticks", "5", "--single-ticks", "5", "--repeats", "2"]
    result = measured(tmp_path, Env, *words)
    batched = ("batched_env_steps_per_s", "batched_env_steps_per_s_converged")
    rates = (*batched, "batched_env_over_hopper_v5", "single_env_over_hopper_v5")
    steps = ("single_env", "stepper", "stepper_with_effects", "mujoco_batch")
    ratios = ("stepper_over_mujoco", "stepper_with_effects_over_mujoco")
    assert all(result[name] > 0 for name in (*rates, *ratios, *(f"{s}_step_s" for s in steps)))
    assert result["setup"]["substeps"] == 10
    assert result["setup"]["converged_timestep_s"] == 1.25e-4
    assert {"batched_env_overhead_s", "host", "command"} <= result.keys()


def test_apexes_count_while_the_leg_hops_and_has_settled():
    time = np.arange(0, 12, 0.005)
    part = np.where(time < 1, Part.RISE, np.where(time < 11, Part.HOP, Part.SINK))
    trace = Trace(pl.DataFrame({"time_s": time, "part": part}))
    watched = np.arange(0, 12, 0.01)
    height = 0.3 - 0.1 * (1 - np.cos(2 * np.pi * (watched - 0.25) / 0.5)) / 2
    clearance = np.where(watched < 6, 0.0, height - 0.15)
    found = settled_apexes(trace, np.column_stack([watched + 7.0, height, height - 0.15]))
    assert len(found) == pytest.approx(16, abs=1)
    np.testing.assert_allclose(found, 0.3, atol=1e-3)
    grounded = settled_apexes(trace, np.column_stack([watched, height, clearance]))
    assert len(grounded) == pytest.approx(10, abs=1)


@pytest.mark.slow
def test_the_leg_hops_through_the_wire_as_in_process(tmp_path):
    words = ["--controller", "energy-shaping", "--minutes", "0.05", "--seconds", "4"]
    result = measured(tmp_path, Deploy, *words)
    percentiles = ["p50", "p99", "p99.9", "max"]
    assert list(result["bare_wake_late_us"]) == percentiles
    assert result["ticks"] or result["stops"]  # A busy computer's loop is late, and may be stopped.
    if result["ticks"]:
        assert 0 <= result["share_on_time"] <= 1
        assert list(result["tick_us"]) == list(result["wake_late_us"]) == percentiles
    for row in result["heights"]:
        assert abs(row["relative_difference"]) < 0.05
