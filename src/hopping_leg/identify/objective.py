"""What a search minimises: recordings, windows, scoring and parameters as one function."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

from hopping_leg.arrays import Array, IntArray
from hopping_leg.identify.cost import Cost, Scoring
from hopping_leg.identify.parameters import ParameterSet
from hopping_leg.identify.recording import Recording
from hopping_leg.identify.robust_loss import RobustLoss, total_costs
from hopping_leg.identify.simulate import WindowSimulator
from hopping_leg.identify.windows import Window
from hopping_leg.robot.model import TIMESTEP


@dataclass(frozen=True)
class Objective:
    """Residuals and costs of search vectors.

    It can be sent to other machines, where it builds its simulations anew.

    Attributes:
        recordings: What was recorded.
        windows: Which stretches count.
        parameters: What vectors mean.
        scoring: What errors count.
        timestep: Physics step, s.
        threads: Worker threads, 0 for one per core.
    """

    recordings: tuple[Recording, ...]
    windows: tuple[Window, ...]
    parameters: ParameterSet
    scoring: Scoring
    timestep: float = TIMESTEP
    threads: int = 0

    @cached_property
    def cost(self) -> Cost:
        """The simulations and their measured counterparts."""
        simulator = WindowSimulator(
            self.recordings, self.windows, timestep=self.timestep, threads=self.threads
        )
        return Cost(simulator, self.scoring)

    def residuals(self, vectors: Array) -> Array:
        """Return residuals of search vectors (n, k), (n, m)."""
        return self.cost.residuals(self.parameters.hypotheses(vectors))

    @property
    def loss(self) -> RobustLoss | None:
        """What windows that no parameters explain are worth; None counts every one in full."""
        return self.cost.loss

    @property
    def jumping(self) -> IntArray | None:
        """Groups of the residuals, (m,), if feet touch down, which makes them jump; else None."""
        grounded = any(
            self.recordings[w.recording].metadata.rig != "fixed-base" for w in self.windows
        )
        return self.cost.groups if grounded else None

    def __call__(self, vectors: Array) -> Array:
        """Return the costs of search vectors (n, k), (n,)."""
        return total_costs(self.residuals(vectors), self.loss)

    def about(self) -> dict[str, Any]:
        """Return what tells this objective from others, for checkpoints."""
        return {
            "recordings": [r.digest or r.name for r in self.recordings],
            "windows": repr(self.windows),
            "base": repr(self.parameters.base),
            "scoring": repr(self.scoring),
            "timestep": self.timestep,
        }

    def __getstate__(self) -> dict[str, Any]:
        return {k: v for k, v in self.__dict__.items() if k != "cost"}
