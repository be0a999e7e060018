"""What a recipe is: everything that decides how a controller is trained."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from hopping_leg.envs import HoppingTask, Reward, TaskConfig
from hopping_leg.rl.actor import network_of
from hopping_leg.rl.onnx_export import Network
from hopping_leg.rl.sb3_env import TaskVecEnv
from hopping_leg.robot.parameters import Robot


@dataclass(frozen=True)
class Recipe(ABC):
    """A way to train a controller; subclasses add the algorithm and its hyper-parameters."""

    name: ClassVar[str]
    """As on the command line."""

    task: TaskConfig = field(default_factory=TaskConfig)
    """The learning problem."""
    heights: tuple[float, float] | None = None
    """Lowest and highest desired height, m, on whatever leg; none takes the task's, which grow with
    the leg."""
    num_envs: int = 16
    """Legs that gather experience at once."""
    steps: int = 1_000_000
    """Control steps of experience in all, summed over the legs."""
    learning_rate: float = 1e-3
    """At the start of its schedule."""
    eval_every: int = 25_000
    """Control steps between two trials of the deterministic policy, for checkpoint selection."""
    eval_start: float = 0.0
    """Share of the training before which no snapshot is tried."""
    eval_commands: tuple[float, ...] = (0.25, 0.30, 0.35)
    """Heights of those trials, m."""
    log_every: int = 32
    """Episodes (SAC) or updates (PPO) between two entries in the TensorBoard log."""
    checkpoint_seconds: float = 60.0
    """Time between checkpoints."""
    privileged_critic: bool = True
    """Let the critic see the true state in training: in flight the joints do not tell the height
    that the reward speaks of."""

    def make_env(self, robot: Robot, seed: int, threads: int = 1) -> TaskVecEnv:
        """Build the training environment."""
        rng = np.random.default_rng(seed)
        task = HoppingTask(robot, self.num_envs, self.task, self.make_reward(robot), rng, threads)
        return TaskVecEnv(task, privileged=self.privileged_critic)

    @abstractmethod
    def make_reward(self, robot: Robot) -> Reward:
        """Build the reward."""

    @abstractmethod
    def make_model(self, env: TaskVecEnv, seed: int) -> Any:  # noqa: ANN401
        """Build the untrained stable-baselines3 model, a subclass of ``AtBoundary``.

        Args:
            env: From ``make_env``.
            seed: Of weights and exploration.
        """

    def anneal(self, model: Any, env: TaskVecEnv, share: float) -> None:  # noqa: ANN401, B027
        """Adapt to the share of the training that is done, 0 to 1; by default nothing changes.

        Called before every rollout, also of a resumed training: depend on ``share`` alone.
        """

    def early_score(self, model: Any) -> float | None:  # noqa: ANN401
        """Return how bad a training is likely to end, m, if that can be told before its end.

        None as long as it cannot; trainings side by side are compared as soon as it can.
        """
        return None

    def extra_results(self, model: Any) -> dict[str, Any]:  # noqa: ANN401
        """Return what else the result of a finished training tells, as JSON values."""
        return {}

    def network(self, model: Any, env: TaskVecEnv) -> Network:  # noqa: ANN401
        """Return the deterministic actor as it stands."""
        return network_of(model, env.task.observation)
