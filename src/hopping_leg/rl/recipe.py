"""What a recipe is: everything that decides how a controller is trained, in parts."""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal, Self

import numpy as np

from hopping_leg import envs, io
from hopping_leg.errors import UsageError
from hopping_leg.rl.dagger import Dagger, DaggerConfig, LabelCollector
from hopping_leg.rl.learner import NetworkConfig
from hopping_leg.rl.ppo import PPO, PPOConfig, RolloutCollector
from hopping_leg.rl.sac import ResumableSAC, SACConfig
from hopping_leg.rl.students import StudentConfig
from hopping_leg.robot import DEFAULT_ROBOT, Robot
from hopping_leg.workers import WorkerGroup

WEIGHT_MOMENT = 0.548
"""Moving mass times straight height of the leg that recipes are meant for, kg m: what hop torques
grow with."""

_PARTS = ("algorithm", "network", "schedule", "selection")
"""Parts whose options are named without the part."""


@dataclass(frozen=True)
class Schedule:
    """Size of a training."""

    num_envs: int
    """Environments that gather experience at once."""
    steps: int
    """Control steps of experience in all, summed over the environments."""
    log_every: int
    """Episodes (SAC) or rollouts (distillation) between two entries in the TensorBoard log."""
    checkpoint_seconds: float = 60.0
    """Time between checkpoints."""
    workers: int = 1
    """Equal parts of the environments with random numbers of their own, which collect rollouts in
    turn or on a cluster."""


@dataclass(frozen=True)
class SelectionConfig:
    """Evaluations by which the policy is selected."""

    eval_every: int
    """Control steps between two evaluations of the deterministic policy."""
    eval_start: float = 0.0
    """Share of the training before which no snapshot is evaluated."""
    eval_commands: tuple[float, ...] = (0.25, 0.30, 0.35)
    """Heights of those evaluations, m."""
    calibrations: int = 0
    """How often the selected policy's command is corrected by its hops' mean errors."""


@dataclass(frozen=True)
class Recipe:
    """A way to train a controller."""

    name: str
    """As in policy files."""
    task: envs.TaskConfig
    """The learning problem."""
    algorithm: PPOConfig | SACConfig | DaggerConfig
    """What learns, with its hyper-parameters."""
    network: NetworkConfig | StudentConfig
    """Sizes of its networks: of actor and critic, or of the student."""
    schedule: Schedule
    """How much of what."""
    selection: SelectionConfig
    """How the policy is chosen."""
    reward: envs.ApexRewardConfig | envs.PaperRewardConfig | None = None
    """Weights of the reward's terms; a student needs none."""
    robot: str = DEFAULT_ROBOT
    """The robot that it is meant for, unless another is named."""
    legs: Literal["robot", "any"] = "robot"
    """What it is trained on: the robot, or as many legs of any size as there are environments."""
    heights: tuple[float, float] | None = None
    """Lowest and highest desired height, m, on whatever leg; none takes the task's, which grow with
    the leg."""
    reward_terms: tuple[envs.RewardTerm, ...] = ()
    """Terms of one's own, beside the reward's."""

    def replace(self, changes: Mapping[str, Any] | None = None, **more: Any) -> Self:  # noqa: ANN401
        """Return the recipe with options changed, by the names of ``paths`` or of whole parts."""
        paths, changed = self.paths(), self
        for name, value in {**(changes or {}), **more}.items():
            changed = io.replace_at(changed, paths.get(name, name), value)
        return changed

    def paths(self) -> dict[str, str]:
        """Return where every option is, by its name.

        Those of task and reward are named with the part, as ``reward.jerk``; of the others only
        those of a part's part, as ``teacher.taper``.
        """
        parts = ("task", "reward", *_PARTS)
        found = [path for part in parts for path in _paths(getattr(self, part), part)]
        return {p.partition(".")[2] if p.startswith(_PARTS) else p: p for p in found}

    def make_learner(
        self,
        robot: Robot,
        seed: int,
        threads: int = 1,
        legs: Sequence[envs.TaskLeg] = (),
        ray: str | None = None,
    ) -> Dagger | PPO | ResumableSAC:
        """Build the algorithm on its environments, of ``legs`` where these differ, untrained.

        Workers beyond the first are on the cluster of the address ``ray``, of a thread each.
        """
        self.check_workers(ray)
        n, network = self.schedule.workers, self.network
        make = partial(self._make_task, robot, seed)
        tasks = [partial(make, k, legs[k::n], 1 if ray and k else threads) for k in range(n)]
        group = [(task, self.algorithm, seed, k) for k, task in enumerate(tasks)]
        if isinstance(self.algorithm, DaggerConfig):
            assert isinstance(network, StudentConfig), "a distillation has a student"
            return Dagger(WorkerGroup(LabelCollector, group, ray), self.algorithm, network, seed)
        assert isinstance(network, NetworkConfig), "reinforcement learning has a critic"
        if isinstance(self.algorithm, PPOConfig):
            return PPO(WorkerGroup(RolloutCollector, group, ray), self.algorithm, network, seed)
        return self.algorithm.make_learner(tasks[0](), network, seed)

    def check_workers(self, ray: str | None) -> None:
        """Raise ``UsageError`` for workers or a cluster that are of no use to the recipe."""
        count, workers = self.schedule.num_envs, self.schedule.workers
        if workers < 1 or count % workers:
            raise UsageError(f"num_envs, {count}, must be a multiple of workers, {workers}.")
        if isinstance(self.algorithm, SACConfig) and (ray or workers > 1):
            raise UsageError("Soft actor-critic has one worker, here; leave workers and --ray out.")
        if ray and workers == 1 and self.legs == "robot":
            raise UsageError("--ray is for more than one worker; give e.g. --set workers=4.")

    def _make_task(
        self, robot: Robot, seed: int, number: int, legs: Sequence[envs.TaskLeg], threads: int
    ) -> envs.HoppingTask:
        """Build a worker's environments; those of worker 0 draw as those of a single one."""
        count, options = self.schedule.num_envs // self.schedule.workers, self.task
        rng = np.random.default_rng([seed, 0, number])
        if isinstance(self.algorithm, DaggerConfig):
            low, high = options.command_bounds
            beyond = (low, high + self.algorithm.headroom)
            options = dataclasses.replace(options, command_range=beyond)
        return envs.HoppingTask(
            robot, count, options, self.make_reward(robot), rng, threads, legs=legs
        )

    def make_reward(self, robot: Robot) -> envs.Reward:
        """Build the reward."""
        if self.reward is None:
            return envs.Reward(self.reward_terms)
        if isinstance(self.reward, envs.PaperRewardConfig):
            reward = envs.paper_reward(robot, self.reward)
        else:
            reward = envs.apex_reward(robot, self.reward, self.task.rate)
        return reward.with_terms(*self.reward_terms) if self.reward_terms else reward

    def fit(self, robot: Robot) -> Self:
        """Return the recipe with heights and torques scaled to a robot.

        Heights grow with the straight leg, rounded to 5 mm; torques with mass times length, rounded
        to 0.5 N m and within the motors' limit. A leg of the paper's height keeps the recipe.
        Heights that the recipe gives as they are stay so; evaluations lie in their inner four
        fifths.

        Raises:
            UsageError: Those heights are no range of heights.
        """
        grown = self._grow(robot)
        return grown if grown.heights is None else grown.within(*grown.heights)

    def within(self, low: float, high: float) -> Self:
        """Return the recipe with other lowest and highest desired heights, m."""
        task = dataclasses.replace(self.task, command_range=(low, high))
        edge = 0.1 * (high - low)
        commands = np.linspace(low + edge, high - edge, len(self.selection.eval_commands))
        return self.replace(
            task=task, eval_commands=tuple(float(_round(height)) for height in commands)
        )

    def _grow(self, robot: Robot) -> Self:
        ratio = robot.size
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
            action_torque=(hip, knee),
        )
        heights = tuple(_round(c * ratio) for c in self.selection.eval_commands)
        return self.replace(task=fitted, eval_commands=heights)


def _paths(config: Any, path: str) -> list[str]:  # noqa: ANN401
    if not dataclasses.is_dataclass(config):
        return [path]
    names = [field.name for field in dataclasses.fields(config)]
    return [p for name in names for p in _paths(getattr(config, name), f"{path}.{name}")]


def _round(value: float, step: float = 0.005) -> float:
    return round(round(value / step) * step, 6)
