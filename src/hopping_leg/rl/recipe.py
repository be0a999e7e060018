"""What a recipe is: everything that decides how a controller is trained, in parts."""

import dataclasses
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from hopping_leg import envs, io
from hopping_leg.controllers import shooting
from hopping_leg.rl import algorithms, onnx_export, sb3_env, sb3_policies
from hopping_leg.rl.distillation.distillation import Distillation
from hopping_leg.robot.parameters import Robot

HEIGHT = 0.30
"""Straight height of the leg that the recipes' lengths are meant for, m."""

WEIGHT_MOMENT = 0.548
"""Its moving mass times its straight height, kg m: what hop torques grow with."""

_PARTS = ("algorithm", "network", "schedule", "selection", "distillation")
"""Parts whose options are named without the part."""


@dataclass(frozen=True)
class Schedule:
    """Size of a training."""

    num_envs: int
    """Environments that gather experience at once."""
    steps: int
    """Control steps of experience in all, summed over the environments."""
    log_every: int
    """Episodes (SAC) or updates (PPO) between two entries in the TensorBoard log."""
    checkpoint_seconds: float = 60.0
    """Time between checkpoints."""


@dataclass(frozen=True)
class SelectionConfig:
    """Evaluations by which the policy is selected."""

    eval_every: int
    """Control steps between two evaluations of the deterministic policy."""
    eval_start: float = 0.0
    """Share of the training before which no snapshot is evaluated."""
    eval_commands: tuple[float, ...] = (0.25, 0.30, 0.35)
    """Heights of those evaluations, m."""


@dataclass(frozen=True)
class Recipe:
    """A way to train a controller."""

    name: str
    """As in policy files."""
    task: envs.TaskConfig
    """The learning problem."""
    reward: envs.ApexRewardConfig | envs.PaperRewardConfig
    """Weights of the reward's terms."""
    algorithm: algorithms.PPOConfig | algorithms.SACConfig
    """What learns, with its hyper-parameters; the teacher's where there is a distillation."""
    network: algorithms.NetworkConfig
    """Sizes of its networks."""
    schedule: Schedule
    """How much of what."""
    selection: SelectionConfig
    """How the policy is chosen."""
    distillation: Distillation | None = None
    """Teacher and student, instead of a policy that learns by the algorithm itself."""
    heights: tuple[float, float] | None = None
    """Lowest and highest desired height, m, on whatever leg; none takes the task's, which grow with
    the leg."""
    reward_terms: tuple[envs.RewardTerm, ...] = ()
    """Terms of one's own, beside the reward's."""
    source: str | None = None
    """``FILE.py:NAME`` of a recipe of one's own."""

    def replace(self, changes: Mapping[str, Any] | None = None, **more: Any) -> Self:  # noqa: ANN401
        """Return the recipe with options changed, by the names of ``paths`` or of whole parts."""
        paths, changed = dict(self.paths()), self
        for name, value in {**(changes or {}), **more}.items():
            changed = io.replace_at(changed, paths.get(name, name), value)
        return changed

    def paths(self) -> Iterator[tuple[str, str]]:
        """Yield the name of every option and where it is.

        Those of task and reward are named with the part, as ``reward.jerk``; of the others only
        those of a part's part, as ``dagger.batch_size``.
        """
        for part in ("task", "reward", *_PARTS):
            config = getattr(self, part)
            for option in dataclasses.fields(config) if config is not None else ():
                inner = getattr(config, option.name)
                if part not in _PARTS:
                    yield f"{part}.{option.name}", f"{part}.{option.name}"
                elif dataclasses.is_dataclass(inner):
                    for f in dataclasses.fields(inner):
                        yield f"{option.name}.{f.name}", f"{part}.{option.name}.{f.name}"
                else:
                    yield option.name, f"{part}.{option.name}"

    def value(self, name: str) -> Any:  # noqa: ANN401
        """Return an option by its name in ``paths``."""
        found: Any = self
        for part in dict(self.paths())[name].split("."):
            found = getattr(found, part)
        return found

    def make_env(self, robot: Robot, seed: int, threads: int = 1) -> sb3_env.TaskVecEnv:
        """Build the training environment."""
        rng, count = np.random.default_rng(seed), self.schedule.num_envs
        task = envs.HoppingTask(robot, count, self.task, self.make_reward(robot), rng, threads)
        computed = self.distillation is not None and self.distillation.teacher == "shooting"
        teacher = shooting.Shooting(robot, rate=self.task.rate) if computed else None
        return sb3_env.TaskVecEnv(task, privileged=self.network.privileged_critic, teacher=teacher)

    def make_reward(self, robot: Robot) -> envs.Reward:
        """Build the reward."""
        if isinstance(self.reward, envs.PaperRewardConfig):
            length = self.task.start_length
            reward = envs.paper_reward(robot, dataclasses.replace(self.reward, rest_length=length))
        else:
            reward = envs.apex_reward(robot, self.reward, self.task.rate)
        return reward.with_terms(*self.reward_terms) if self.reward_terms else reward

    def make_model(self, env: sb3_env.TaskVecEnv, seed: int) -> Any:  # noqa: ANN401
        """Build the untrained stable-baselines3 model, a subclass of ``AtBoundary``."""
        if self.distillation is None:
            return self.algorithm.make_model(env, self.network, seed)
        commands = self.selection.eval_commands
        return self.distillation.make_model(env, self._ppo, self.network, commands, seed)

    def anneal(self, model: Any, env: sb3_env.TaskVecEnv, share: float) -> None:  # noqa: ANN401
        """Adapt to the share of the training that is done, 0 to 1.

        Called before every rollout, also of a resumed training: depends on ``share`` alone.
        """
        if self.distillation is not None:
            self.distillation.anneal(model, env, share, self._ppo)
            return
        env.task.reward.anneal(share)
        self.algorithm.anneal(model, share)

    def early_score(self, model: Any) -> float | None:  # noqa: ANN401
        """Return how bad a training is likely to end, m; None as long as that is unknown."""
        return self.distillation.early_score(model) if self.distillation else None

    def extra_results(self, model: Any) -> dict[str, Any]:  # noqa: ANN401
        """Return what else the result of a finished training tells, as JSON values."""
        return self.distillation.extra_results(model) if self.distillation else {}

    def actor(self, model: Any, env: sb3_env.TaskVecEnv) -> onnx_export.Network:  # noqa: ANN401
        """Return the deterministic actor as it stands."""
        if self.distillation is not None:
            return self.distillation.network(model, env)
        return sb3_policies.network_of(model, env.task.observation)

    @property
    def _ppo(self) -> algorithms.PPOConfig:
        assert isinstance(self.algorithm, algorithms.PPOConfig), "a teacher learns by PPO"
        return self.algorithm

    def fit(self, robot: Robot) -> Self:
        """Return the recipe with heights, lengths and torques scaled to a robot.

        Heights and lengths grow with the straight leg, rounded to 5 mm; torques with mass times
        length, rounded to 0.5 N m and within the motors' limit. A leg of the paper's height keeps
        the recipe. Heights that the recipe gives as they are stay so; evaluations lie in their
        inner four fifths.

        Raises:
            UsageError: Those heights are no range of heights.
        """
        grown = self._grow(robot)
        if grown.heights is None:
            return grown
        task = dataclasses.replace(grown.task, command_range=grown.heights)
        low, high = task.command_bounds
        edge = 0.1 * (high - low)
        commands = np.linspace(low + edge, high - edge, len(grown.selection.eval_commands))
        return grown.replace(
            task=task, eval_commands=tuple(float(_round(height)) for height in commands)
        )

    def _grow(self, robot: Robot) -> Self:
        ratio = robot.straight_height / HEIGHT
        if abs(ratio - 1) < 0.01:
            return self
        task = self.task
        low, high = task.command_range or (0.0, 0.0)
        moment = robot.mass * robot.straight_height / WEIGHT_MOMENT
        limit = robot.of_joints("torque_limit")
        hip, knee = (
            min(_round(torque * moment, 0.5), float(most))
            for torque, most in zip(task.action_torque, limit, strict=True)
        )
        fitted = dataclasses.replace(
            task,
            commands=tuple(_round(c * ratio) for c in task.commands),
            command_range=task.command_range and (_round(low * ratio), _round(high * ratio)),
            start_length=_round(task.start_length * ratio),
            drop_length=(_round(task.drop_length[0] * ratio), _round(task.drop_length[1] * ratio)),
            action_torque=(hip, knee),
        )
        heights = tuple(_round(c * ratio) for c in self.selection.eval_commands)
        return self.replace(task=fitted, eval_commands=heights)


def _round(value: float, step: float = 0.005) -> float:
    return round(round(value / step) * step, 6)
