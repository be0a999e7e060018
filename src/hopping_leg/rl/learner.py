"""What trains a policy, as ``train`` sees it."""

from collections import deque
from collections.abc import Callable
from typing import Protocol

import numpy as np
from stable_baselines3.common.logger import Logger

from hopping_leg.arrays import Array
from hopping_leg.envs.observation import Observation
from hopping_leg.rl.checkpoint import Tree
from hopping_leg.rl.onnx_export import Actor


class RecentHops:
    """The latest hops of all legs, for live numbers."""

    def __init__(self) -> None:
        self.count = 0
        """In-flight apexes so far."""
        self._errors: deque[float] = deque(maxlen=500)

    @property
    def mean_error(self) -> float:
        """Mean |apex - command| over the latest hops, m; NaN before the first."""
        return float(np.mean(np.abs(self._errors))) if self._errors else float("nan")

    def add(self, errors: Array) -> None:
        """Add a tick's apex errors, m, (n,), NaN where there is no apex."""
        found = errors[~np.isnan(errors)]
        self.count += len(found)
        self._errors.extend(found.tolist())

    def state(self) -> Tree:
        """Return everything needed to go on."""
        return {"count": self.count, "errors": np.array(self._errors)}

    def restore(self, state: Tree) -> None:
        """Go on from a ``state``."""
        self.count = state["count"]
        self._errors.clear()
        self._errors.extend(state["errors"].tolist())


class Learner(Protocol):
    """An algorithm on its environments; names are those of stable-baselines3.

    Attributes:
        num_timesteps: Control steps of experience so far.
        observation: What makes its observations.
        recent_hops: The latest hops.
        seconds: Time spent on each part.
        share: Share of the training that is done, 0 to 1.
        logger: Where the curves go.
        on_boundary: Called before every rollout: a state taken there continues exactly.
        remaining: Returns the share of the budget that is left, 1 to 0; the schedules follow this
            or the share of steps left, whichever is smaller.
    """

    num_timesteps: int
    seconds: dict[str, float]
    on_boundary: Callable[[], None] | None
    remaining: Callable[[], float] | None

    @property
    def observation(self) -> Observation: ...  # noqa: D102

    @property
    def recent_hops(self) -> RecentHops: ...  # noqa: D102

    @property
    def share(self) -> float: ...  # noqa: D102

    @property
    def logger(self) -> Logger: ...  # noqa: D102

    def set_logger(self, logger: Logger) -> None: ...  # noqa: D102

    def train_until(self, steps: int, callback: Callable[[], bool], log_interval: int) -> None:
        """Learn until so many control steps are done in all, or until the callback says no."""
        ...

    def network(self) -> Actor:
        """Return the deterministic actor as it stands."""
        ...

    def state(self) -> Tree:
        """Return everything needed to continue exactly, environments included."""
        ...

    def restore(self, state: Tree) -> None:
        """Go on from a ``state``."""
        ...
