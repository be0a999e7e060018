"""The latest hops of a training, for live numbers."""

from collections import deque

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.rl.checkpoint import Tree


class RecentHops:
    """The latest hops of all legs."""

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
