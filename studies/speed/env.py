"""Speed of the stepper beside MuJoCo, and of the environments around it.

The environment runs once while its motor torques are recorded. Then, in turn, it runs again from
the same state, and bare physics gets the recorded torques: the stepper and ``mujoco.batch`` on one
thread, for the plain leg, and the stepper with every effect of the twin. All simulate the same
motion, so that their ratios are what physics, noise, delay, reward and observation cost.
"""

from dataclasses import dataclass, replace
from typing import Any

import gymnasium
import mujoco
import numpy as np
from mujoco import batch

from hopping_leg.arrays import Array
from hopping_leg.cli.options import JsonFile, RobotFile, at_least
from hopping_leg.envs import HoppingEnv, HoppingTask, TaskConfig, paper_reward
from hopping_leg.robot import COARSE_TIMESTEP, DEFAULT_ROBOT, TIMESTEP, build_model, load_robot
from hopping_leg.robot.kinematics import joint_angles
from hopping_leg.sim import LegSimulator
from studies.shared import Row, Timed, host, interleave, show_numbers

_BENT, _STRETCHED = 0.55, 0.8
"""Leg lengths of the recorded motion over the straight leg's."""

_PERIOD = 0.5
"""Of the recorded motion, s."""

_STIFFNESS, _DAMPING = 40.0, 1.0
"""Of its joints, N m/rad and N m s/rad."""


@dataclass(frozen=True)
class Env:
    """Time the environment against bare physics and Gymnasium's Hopper-v5.

    The batched environment is also timed at the converged physics step.
    """

    robot: RobotFile = DEFAULT_ROBOT
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
    json: JsonFile = None

    def measure(self) -> Row:
        """Time everything in turn, print and return every number.

        Times of the stepper and of MuJoCo are those of a physics step per leg and thread.
        """
        at_least(1, count=self.count, repeats=self.repeats)
        at_least(1, ticks=self.ticks, single_ticks=self.single_ticks)
        functions, substeps = self._functions()
        steps = dict.fromkeys(functions, self.count * self.ticks)
        steps |= dict.fromkeys(("single_env", "hopper_v5"), self.single_ticks)
        taken = {k: t / steps[k] for k, t in interleave(functions, self.repeats).items()}
        typical = {name: float(np.median(times)) for name, times in taken.items()}

        def ratio(over: str, under: str) -> float:
            return float(np.median(taken[over] / taken[under]))

        result = {
            "stepper_step_s": typical["stepper"] / substeps,
            "stepper_with_effects_step_s": typical["stepper_with_effects"] / substeps,
            "mujoco_batch_step_s": typical["mujoco_batch"] / substeps,
            "stepper_over_mujoco": ratio("mujoco_batch", "stepper"),
            "stepper_with_effects_over_mujoco": ratio("mujoco_batch", "stepper_with_effects"),
            "batched_env_steps_per_s": 1 / typical["batched_env"],
            "batched_env_steps_per_s_converged": 1 / typical["batched_env_converged"],
            "batched_env_overhead_s": float(
                np.median(taken["batched_env"] - taken["batched_physics"])
            ),
            "single_env_step_s": typical["single_env"],
            "single_env_over_hopper_v5": ratio("hopper_v5", "single_env"),
            "batched_env_over_hopper_v5": ratio("hopper_v5", "batched_env"),
            "setup": {
                "robot": load_robot(self.robot).name,
                "legs": self.count,
                "threads": self.threads,
                "repeats": self.repeats,
                "timestep_s": COARSE_TIMESTEP,
                "converged_timestep_s": TIMESTEP,
                "substeps": substeps,
                "noise_and_delay": True,
            },
            "host": host(),
        }
        show_numbers("Environment with noise and delay", result)
        return result

    def _functions(self) -> tuple[dict[str, Timed], int]:
        """Return what is timed, and the physics steps of a control period."""
        robot, rng = load_robot(self.robot), np.random.default_rng(0)
        hip, knee = robot.of_joints("torque_limit").tolist()
        options = TaskConfig(action_torque=(hip, knee), timestep=COARSE_TIMESTEP, episode=3600.0)
        task, fine = (
            HoppingTask(robot, self.count, each, paper_reward(robot), rng, self.threads)
            for each in (options, replace(options, timestep=TIMESTEP))
        )
        many, many_fine = record(task, self.ticks), record(fine, self.ticks)
        env = HoppingEnv(robot, options)
        env.reset(seed=0)
        one = record(env.task, self.single_ticks)
        bare, plain, twin = (
            LegSimulator(leg, self.count, timestep=COARSE_TIMESTEP, threads=threads)
            for leg, threads in ((robot, self.threads), (robot, 1), (load_robot("twin"), 1))
        )
        hopper = gymnasium.make(
            "Hopper-v5", frame_skip=bare.substeps, terminate_when_unhealthy=False
        ).unwrapped
        hopper.reset(seed=0)
        return {
            "batched_env": lambda: _run_task(task, many),
            "batched_env_converged": lambda: _run_task(fine, many_fine),
            "batched_physics": lambda: _run_legs(bare, many),
            "stepper": lambda: _run_legs(plain, many),
            "stepper_with_effects": lambda: _run_legs(twin, many),
            "mujoco_batch": _mujoco_batch(plain, many),
            "single_env": lambda: _run_env(env, one),
            "hopper_v5": lambda: _run_hopper(hopper, self.single_ticks),
        }, bare.substeps


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
    for action in motion.actions[:, 0].astype(np.float32):
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
