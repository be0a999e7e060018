"""Speed of the stepper beside MuJoCo, and of the environments around it.

The environment runs once while its motor torques are recorded. Then, in turn, it runs again from
the same state, and bare physics gets the recorded torques: the stepper and ``mujoco.batch`` on one
thread, for the plain leg, and the stepper with every effect of the twin. All simulate the same
motion, so that their ratios are what physics, noise, delay, reward and observation cost.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium
import mujoco
import numpy as np
from mujoco import batch
from rich.progress import Progress
from rich.table import Table

from hopping_leg.arrays import Array
from hopping_leg.cli.options import at_least
from hopping_leg.envs import HoppingEnv, HoppingTask, TaskConfig, paper_reward
from hopping_leg.robot import COARSE_TIMESTEP, DEFAULT_ROBOT, build_model, load_robot
from hopping_leg.robot.kinematics import joint_angles
from hopping_leg.sim import LegSimulator
from hopping_leg.terminal import plain_console
from studies.shared import Timed, host, interleave, median_ratio

_BENT, _STRETCHED = 0.55, 0.8
"""Leg lengths of the recorded motion over the straight leg's."""

_PERIOD = 0.5
"""Of the recorded motion, s."""

_STIFFNESS, _DAMPING = 40.0, 1.0
"""Of its joints, N m/rad and N m s/rad."""


@dataclass(frozen=True)
class Env:
    """Time the environment against bare physics and Gymnasium's Hopper-v5."""

    robot: str = DEFAULT_ROBOT
    """A shipped name or the path of a .toml file."""
    count: int = 512
    """Legs of the batched environment."""
    ticks: int = 50
    """Control periods of a batched round."""
    single_ticks: int = 500
    """Control periods of a round of the single environment."""
    repeats: int = 15
    """Rounds; medians over them are reported."""
    threads: int = 0
    """Of the batched environment and the batched physics alike, 0 for one per core."""
    timestep: float = COARSE_TIMESTEP
    """Physics step, s."""
    seed: int = 0
    """Of noise and delay."""
    json: Path | None = None
    """Write every number to this file."""

    def measure(self) -> dict[str, Any]:
        """Run it, print a table, return every number."""
        at_least(1, count=self.count, repeats=self.repeats)
        at_least(1, ticks=self.ticks, single_ticks=self.single_ticks)
        at_least(0, threads=self.threads, seed=self.seed)
        with Progress(transient=True) as bar:
            task = bar.add_task("timing", total=self.repeats)
            result = bench_env(self, lambda done, _: bar.update(task, completed=done))
        _print("Environment with noise and delay", result)
        return result


@dataclass(frozen=True)
class Motion:
    """One hopping motion: the actions that lead to it and the motors' mean torques.

    Attributes:
        actions: (ticks, n, 2).
        torques: At the joints, N m, (ticks, n, 2).
        start: State of the task at the first tick.
    """

    actions: Array
    torques: Array
    start: dict[str, Any]


def bench_env(
    benchmark: Env, on_repeat: Callable[[int, int], None] | None = None
) -> dict[str, Any]:
    """Time everything in one run, alternating.

    Returns:
        Times of a physics step per leg and thread, s, their ratios, throughput of the batched and
        time of the single environment, ratios to Hopper-v5.
    """
    functions, steps = _functions(benchmark)
    taken = interleave(functions, benchmark.repeats, on_repeat)
    per_step = {name: taken[name] / steps[name] for name in taken}
    typical = {name: float(np.median(times)) for name, times in per_step.items()}
    substeps = _substeps(benchmark)
    return {
        "stepper_step_s": typical["stepper"] / substeps,
        "stepper_with_effects_step_s": typical["stepper_with_effects"] / substeps,
        "mujoco_batch_step_s": typical["mujoco_batch"] / substeps,
        "stepper_over_mujoco": median_ratio(per_step["mujoco_batch"], per_step["stepper"]),
        "stepper_with_effects_over_mujoco": median_ratio(
            per_step["mujoco_batch"], per_step["stepper_with_effects"]
        ),
        "batched_env_steps_per_s": 1 / typical["batched_env"],
        "batched_env_overhead_s": float(
            np.median(per_step["batched_env"] - per_step["batched_physics"])
        ),
        "single_env_step_s": typical["single_env"],
        "single_env_over_hopper_v5": median_ratio(per_step["hopper_v5"], per_step["single_env"]),
        "batched_env_over_hopper_v5": median_ratio(per_step["hopper_v5"], per_step["batched_env"]),
        "setup": _setup(benchmark),
        "host": host(),
    }


def _substeps(benchmark: Env) -> int:
    return round(1 / (_options(benchmark).rate * benchmark.timestep))


def _setup(benchmark: Env) -> dict[str, Any]:
    return {
        "robot": load_robot(benchmark.robot).name,
        "legs": benchmark.count,
        "threads": benchmark.threads,
        "repeats": benchmark.repeats,
        "timestep_s": benchmark.timestep,
        "substeps": _substeps(benchmark),
        "noise_and_delay": True,
    }


def _options(benchmark: Env) -> TaskConfig:
    limits = load_robot(benchmark.robot).of_joints("torque_limit")
    return TaskConfig(
        action_torque=(float(limits[0]), float(limits[1])),
        timestep=benchmark.timestep,
        episode=3600.0,
    )


def _functions(benchmark: Env) -> tuple[Mapping[str, Timed], Mapping[str, int]]:
    """Return what is timed and how many control periods of one leg each call simulates."""
    robot, options = load_robot(benchmark.robot), _options(benchmark)
    rng = np.random.default_rng(benchmark.seed)
    reward = paper_reward(robot)
    task = HoppingTask(robot, benchmark.count, options, reward, rng, benchmark.threads)
    many = record(task, benchmark.ticks)
    env = HoppingEnv(robot, options)
    env.reset(seed=benchmark.seed)
    one = record(env.task, benchmark.single_ticks)
    bare = LegSimulator(
        robot, benchmark.count, timestep=benchmark.timestep, threads=benchmark.threads
    )
    plain = LegSimulator(robot, benchmark.count, timestep=benchmark.timestep, threads=1)
    twin = LegSimulator(load_robot("twin"), benchmark.count, timestep=benchmark.timestep, threads=1)
    leg = gymnasium.make(
        "Hopper-v5", frame_skip=bare.substeps, terminate_when_unhealthy=False
    ).unwrapped
    leg.reset(seed=benchmark.seed)
    functions = {
        "batched_env": lambda: _run_task(task, many),
        "batched_physics": lambda: _run_legs(bare, many),
        "stepper": lambda: _run_legs(plain, many),
        "stepper_with_effects": lambda: _run_legs(twin, many),
        "mujoco_batch": _mujoco_batch(plain, many),
        "single_env": lambda: _run_env(env, one),
        "hopper_v5": lambda: _run_hopper(leg, benchmark.single_ticks),
    }
    of_one = {"single_env": benchmark.single_ticks, "hopper_v5": benchmark.single_ticks}
    return functions, {
        name: of_one.get(name, benchmark.count * benchmark.ticks) for name in functions
    }


def record(task: HoppingTask, ticks: int) -> Motion:
    """Let the legs stretch and bend so fast that they hop, and record it to be repeated."""
    lengths = np.array([[_BENT, 0.0], [_STRETCHED, 0.0]]) * task.robot.straight_height
    postures = joint_angles(task.robot, lengths)
    half = round(_PERIOD * task.options.rate / 2)
    task.reset()
    start = task.state()
    actions, torques = np.empty((2, ticks, task.count, 2))
    for tick in range(ticks):
        seen, target = task.measurement, postures[tick // half % 2]
        torque = _STIFFNESS * (target - seen.q[:, 0]) - _DAMPING * seen.qd[:, 0]
        actions[tick] = np.clip(torque / task.options.action_torque, -1, 1).astype(np.float32)
        task.step(actions[tick])
        torques[tick] = task.applied_torque
    return Motion(actions, torques, start)


def _run_task(task: HoppingTask, motion: Motion) -> None:
    task.restore(motion.start)
    for action in motion.actions:
        task.step(action)


def _run_env(env: HoppingEnv, motion: Motion) -> None:
    env.task.restore(motion.start)
    actions = motion.actions[:, 0].astype(np.float32)
    for action in actions:
        env.step(action)


def _run_legs(legs: LegSimulator, motion: Motion) -> None:
    start = motion.start["legs"]["state"]
    legs.place(slice(None), start[:, 0], start[:, 1:3])
    legs.state[:] = start
    for torque in motion.torques:
        legs.step(torque)


def _mujoco_batch(legs: LegSimulator, motion: Motion) -> Timed:
    """Return MuJoCo's batch on one thread under the same torques."""
    model = build_model(legs.robot, legs.timestep)
    simulation = batch.Batch(model, legs.count, 1)
    first = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_TIME)
    state, control = simulation.state[:, first : first + 6], simulation.bind("ctrl")
    controls = motion.torques / legs.robot.of_joints("belt_ratio")

    def run() -> None:
        state[:] = motion.start["legs"]["state"]
        for row in controls:
            control[:] = row
            simulation.step(nstep=legs.substeps)

    return run


def _run_hopper(leg: Any, ticks: int) -> None:  # noqa: ANN401
    """Step Hopper-v5 with random actions, as a policy at the start of training would."""
    leg.reset()
    for action in leg.np_random.uniform(-1, 1, (ticks, 3)):
        leg.step(action)


def _print(title: str, result: dict[str, Any]) -> None:
    table = Table("number", "value", title=title)
    for name, value in result.items():
        if isinstance(value, int | float):
            table.add_row(name, f"{value:,.4g}" if value < 100 else f"{value:,.0f}")
    plain_console().print(table)
