"""Speed of the environment against the bare physics inside it and against Gymnasium's Hopper-v5.

The environment first runs once while its motor torques are recorded. Then it runs again from the
same state, in turn with bare physics that gets the recorded torques: both simulate the very same
motion, so their difference is what noise, delay, limits, reward, observation and episodes cost.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium
import mujoco
import numpy as np
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from hopping_leg.arrays import Array
from hopping_leg.cli.options import at_least
from hopping_leg.envs import HoppingEnv, HoppingTask, TaskConfig, paper_reward
from hopping_leg.robot import TIMESTEP, Robot, build_model, load_robot
from hopping_leg.robot.kinematics import joint_angles
from hopping_leg.sim import MujocoSimulator
from studies.shared import Timed, host, interleave, median_ratio

_BENT, _STRETCHED = 0.55, 0.8
"""Leg lengths of the recorded motion over the straight leg's."""

_PERIOD = 0.5
"""Of the recorded motion, s."""

_STIFFNESS, _DAMPING = 40.0, 1.0
"""Of its joints, N m/rad and N m s/rad."""


@dataclass(frozen=True)
class EnvBenchmark:
    """What is timed, and how long."""

    robot: Robot
    count: int = 512
    """Legs of the batched environment."""
    ticks: int = 50
    """Control periods of a batched round."""
    single_ticks: int = 500
    """Control periods of a round of the single environment."""
    repeats: int = 15
    """Rounds; medians over them are reported."""
    threads: int = 0
    """Of batched environment and batched physics alike, 0 for one per core."""
    timestep: float = 5e-4
    """Physics step, s."""
    seed: int = 0


@dataclass(frozen=True)
class Motion:
    """One hopping motion: the actions that lead to it and the motor torques that were applied.

    Attributes:
        actions: (ticks, n, 2).
        controls: At the motors, N m, (ticks, n, 2).
        start: State of the task at the first tick.
    """

    actions: Array
    controls: Array
    start: dict[str, Any]


def bench_env(
    benchmark: EnvBenchmark, on_repeat: Callable[[int, int], None] | None = None
) -> dict[str, Any]:
    """Time everything in one run, alternating.

    Returns:
        ``batched_env_steps_per_s``, ``batched_env_over_bare_physics`` (throughput, 1 is free),
        ``single_env_cost_over_bare_physics`` (time, 1 is free), ratios to Hopper-v5, and more.
    """
    functions, steps = _functions(benchmark)
    taken = interleave(functions, benchmark.repeats, on_repeat)
    rate = {name: float(np.median(steps[name] / taken[name])) for name in taken}
    batched = taken["batched_env"] / steps["batched_env"]
    single = taken["single_env"] / steps["single_env"]
    leg = taken["hopper_v5"] / steps["hopper_v5"]
    bare = taken["single_mj_step"] / steps["single_mj_step"]
    return {
        "batched_env_steps_per_s": rate["batched_env"],
        "batched_env_over_bare_physics": median_ratio(
            taken["batched_physics"], taken["batched_env"]
        ),
        "single_env_cost_over_bare_physics": median_ratio(single, bare),
        "single_env_cost_over_one_leg_batch": median_ratio(
            taken["single_env"], taken["single_batch"]
        ),
        "single_env_steps_per_s": rate["single_env"],
        "batched_physics_steps_per_s": rate["batched_physics"],
        "single_physics_steps_per_s": rate["single_mj_step"],
        "hopper_v5_steps_per_s": rate["hopper_v5"],
        "single_env_over_hopper_v5": median_ratio(leg, single),
        "batched_env_over_hopper_v5": median_ratio(leg, batched),
        "single_env_overhead_us": float(np.median(single - bare) * 1e6),
        "setup": _setup(benchmark),
        "host": host(),
    }


def _setup(benchmark: EnvBenchmark) -> dict[str, Any]:
    options = _options(benchmark)
    return {
        "robot": benchmark.robot.name,
        "legs": benchmark.count,
        "threads": benchmark.threads,
        "repeats": benchmark.repeats,
        "timestep_s": benchmark.timestep,
        "substeps": round(1 / (options.rate * options.timestep)),
        "noise_and_delay": True,
    }


def _options(benchmark: EnvBenchmark) -> TaskConfig:
    limits = benchmark.robot.of_joints("torque_limit")
    return TaskConfig(
        action_torque=(float(limits[0]), float(limits[1])),
        timestep=benchmark.timestep,
        episode=3600.0,
    )


def _functions(benchmark: EnvBenchmark) -> tuple[Mapping[str, Timed], Mapping[str, int]]:
    """Return what is timed and how many control periods of one leg each call simulates."""
    robot, options = benchmark.robot, _options(benchmark)
    rng = np.random.default_rng(benchmark.seed)
    reward = paper_reward(robot)
    task = HoppingTask(robot, benchmark.count, options, reward, rng, benchmark.threads)
    many = record(task, benchmark.ticks)
    env = HoppingEnv(robot, options)
    env.reset(seed=benchmark.seed)
    one = record(env.task, benchmark.single_ticks)
    bare = MujocoSimulator(
        robot, benchmark.count, timestep=benchmark.timestep, threads=benchmark.threads
    )
    lone = MujocoSimulator(robot, 1, timestep=benchmark.timestep, threads=1)
    leg = gymnasium.make(
        "Hopper-v5", frame_skip=bare.substeps, terminate_when_unhealthy=False
    ).unwrapped
    leg.reset(seed=benchmark.seed)
    functions = {
        "batched_env": lambda: _run_task(task, many),
        "batched_physics": lambda: _run_batch(bare, many),
        "single_env": lambda: _run_env(env, one),
        "single_batch": lambda: _run_batch(lone, one),
        "single_mj_step": _mj_step(lone, one),
        "hopper_v5": lambda: _run_hopper(leg, benchmark.single_ticks),
    }
    legs = {"batched_env": benchmark.count, "batched_physics": benchmark.count}
    ticks = {"batched_env": benchmark.ticks, "batched_physics": benchmark.ticks}
    return functions, {
        name: legs.get(name, 1) * ticks.get(name, benchmark.single_ticks) for name in functions
    }


def record(task: HoppingTask, ticks: int) -> Motion:
    """Let the legs stretch and bend so fast that they hop, and record it to be repeated."""
    lengths = np.array([[_BENT, 0.0], [_STRETCHED, 0.0]]) * task.robot.straight_height
    postures = joint_angles(task.robot, lengths)
    half = round(_PERIOD * task.options.rate / 2)
    task.reset()
    start = task.state()
    actions, controls = np.empty((2, ticks, task.count, 2))
    for tick in range(ticks):
        seen, target = task.measurement, postures[tick // half % 2]
        torque = _STIFFNESS * (target - seen.q[:, 0]) - _DAMPING * seen.qd[:, 0]
        actions[tick] = np.clip(torque / task.options.action_torque, -1, 1).astype(np.float32)
        task.step(actions[tick])
        controls[tick] = task.legs.batch.bind("ctrl")
    return Motion(actions, controls, start)


def _run_task(task: HoppingTask, motion: Motion) -> None:
    task.restore(motion.start)
    for action in motion.actions:
        task.step(action)


def _run_env(env: HoppingEnv, motion: Motion) -> None:
    env.task.restore(motion.start)
    actions = motion.actions[:, 0].astype(np.float32)
    for action in actions:
        env.step(action)


def _run_batch(legs: MujocoSimulator, motion: Motion) -> None:
    legs.batch.state[:] = motion.start["physics"]
    control, substeps = legs.batch.bind("ctrl"), legs.substeps
    for row in motion.controls:
        control[:] = row
        legs.batch.step(nstep=substeps)


def _mj_step(legs: MujocoSimulator, motion: Motion) -> Timed:
    """Return the plainest physics there is: MuJoCo's own step on one leg."""
    model = build_model(legs.robot, legs.timestep)
    data = mujoco.MjData(model)
    start, substeps = motion.start["physics"][0], legs.substeps

    def run() -> None:
        mujoco.mj_setState(model, data, start, mujoco.mjtState.mjSTATE_INTEGRATION)
        for row in motion.controls[:, 0]:
            data.ctrl[:] = row
            mujoco.mj_step(model, data, nstep=substeps)

    return run


def _run_hopper(leg: Any, ticks: int) -> None:  # noqa: ANN401
    """Step Hopper-v5 with random actions, as a policy at the start of training would."""
    leg.reset()
    for action in leg.np_random.uniform(-1, 1, (ticks, 3)):
        leg.step(action)


@dataclass(frozen=True)
class Env:
    """Time the environment against bare physics and Gymnasium's Hopper-v5."""

    robot: str = "legv2-paper"
    """A shipped name or the path of a .toml file."""
    count: int = 512
    """Legs of the batched environment."""
    repeats: int = 15
    """Rounds; medians over them are reported."""
    threads: int = 0
    """Of the batched environment and the batched physics alike, 0 for one per core."""
    timestep: float = TIMESTEP
    """Physics step, s."""
    seed: int = 0
    """Of noise and delay."""
    json: Path | None = None
    """Write every number to this file."""

    def measure(self) -> dict[str, Any]:
        """Run it, print a table, return every number."""
        at_least(1, count=self.count, repeats=self.repeats)
        at_least(0, threads=self.threads, seed=self.seed)
        benchmark = EnvBenchmark(
            load_robot(self.robot),
            count=self.count,
            repeats=self.repeats,
            threads=self.threads,
            timestep=self.timestep,
            seed=self.seed,
        )
        with Progress(transient=True) as bar:
            task = bar.add_task("timing", total=self.repeats)
            result = bench_env(benchmark, lambda done, _: bar.update(task, completed=done))
        _print("Environment with noise and delay", result)
        return result


def _print(title: str, result: dict[str, Any]) -> None:
    table = Table("number", "value", title=title)
    for name, value in result.items():
        if isinstance(value, int | float):
            table.add_row(name, f"{value:,.4g}" if value < 100 else f"{value:,.0f}")
    Console().print(table)
