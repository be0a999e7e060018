"""What trainings by rollouts of a ``HoppingTask`` have in common."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from stable_baselines3.common.logger import Logger

from hopping_leg.arrays import Stateful
from hopping_leg.envs.task import HoppingTask


@dataclass(frozen=True)
class NetworkConfig:
    """Networks of actor and critic."""

    actor: tuple[int, ...]
    """Hidden layers of the actor: ReLU in SAC, ELU in PPO."""
    critic: tuple[int, ...]
    """Hidden layers of the critic."""


class Learner(Stateful):
    """Counts control steps, follows a budget and logs, with the names of stable-baselines3.

    Attributes:
        on_boundary: Called before every rollout: a state taken there continues exactly.
        remaining: Returns the share of the budget that is left, 1 to 0; the schedules follow this
            or the share of steps left, whichever is smaller.
    """

    on_boundary: Callable[[], None] | None = None
    remaining: Callable[[], float] | None = None

    def __init__(self, task: HoppingTask) -> None:
        self.task = task
        self.logger = Logger(None, [])
        self.num_timesteps, self._left = 0, 1.0
        self.seconds = {"rollouts": 0.0, "gradient steps": 0.0}
        """Time spent on each."""

    def set_logger(self, logger: Logger) -> None:
        """Set where the curves go."""
        self.logger = logger

    @property
    def share(self) -> float:
        """Share of the training that is done, 0 to 1."""
        return 1 - self._left

    def _rollouts(
        self, size: int, steps: int, callback: Callable[[], bool], log_interval: int
    ) -> Iterator[None]:
        """Yield for every rollout of ``size`` control steps of a training, see ``train_until``."""
        rollouts = 0
        while self.num_timesteps < steps and callback():
            self._left = 1 - self.num_timesteps / steps
            if self.remaining is not None:
                self._left = min(self._left, self.remaining())
            if self.on_boundary is not None:
                self.on_boundary()
            yield
            self.num_timesteps += size
            rollouts += 1
            if rollouts % log_interval == 0:
                self.logger.record("rollout/apex_error_m", self.task.mean_apex_error)
                self.logger.dump(self.num_timesteps)
