"""What trainings by rollouts of a ``HoppingTask`` have in common."""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from stable_baselines3.common.logger import Logger

from hopping_leg.arrays import Stateful
from hopping_leg.envs.task import HoppingTask
from hopping_leg.workers import WorkerGroup


@dataclass(frozen=True)
class NetworkConfig:
    """Networks of actor and critic."""

    actor: tuple[int, ...]
    """Hidden layers of the actor: ReLU in SAC, ELU in PPO."""
    critic: tuple[int, ...]
    """Hidden layers of the critic."""


MakeTask = Callable[[], HoppingTask]  # Builds the task of a collector where that is


class Learner(Stateful):
    """Counts control steps, follows a budget and logs, with the names of stable-baselines3.

    Attributes:
        collectors: What collects rollouts, each on a ``task`` of its own, of equal size.
        task: The first one's, whose hops are logged.
        on_boundary: Called before every rollout: a state taken there continues exactly.
        remaining: Returns the share of the budget that is left, 1 to 0; the schedules follow this
            or the share of steps left, whichever is smaller.
    """

    on_boundary: Callable[[], None] | None = None
    remaining: Callable[[], float] | None = None

    def __init__(self, collectors: WorkerGroup) -> None:
        self.collectors = collectors
        self.task: HoppingTask = collectors.here[0].task
        self.count = self.task.count * collectors.count
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

    def _collect_all(self, *shared: Any, each: Sequence[Any] | None = None) -> list[Any]:  # noqa: ANN401
        """Return arrays (ticks, n, ...) that the collectors return, joined along their legs."""
        began = time.monotonic()
        parts = zip(*self.collectors.call("collect", *shared, each=each), strict=True)
        joined = [np.concatenate(part, axis=1) if part[1:] else part[0] for part in parts]
        self.seconds["rollouts"] += time.monotonic() - began
        return joined

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
