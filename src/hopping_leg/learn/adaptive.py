"""The adaptive recipe: the precise one on legs that differ, for a leg that may be another one.

What it costs in precision on the very leg that was believed, and what it gains on others, is on the
documentation's page about robustness.
"""

from dataclasses import dataclass, field, replace
from typing import ClassVar

from hopping_leg.env import TaskOptions
from hopping_leg.learn.precise import PreciseRecipe
from hopping_leg.sim.variants import SURPRISES


@dataclass(frozen=True)
class AdaptiveRecipe(PreciseRecipe):
    """The precise recipe, longer, for a larger policy that meets many different legs."""

    name: ClassVar[str] = "adaptive"

    task: TaskOptions = field(
        default_factory=lambda: replace(PreciseRecipe().task, randomised=SURPRISES)
    )
    steps: int = 18_000_000
    """Control steps of experience in all, summed over the legs."""
    judge_every: int = 1_000_000
    """Control steps between two trials of the policy, for checkpoint selection."""
    teaching: float = 0.3
    """Share of the training in which the teacher learns; in the rest the policy does."""
    student: tuple[int, ...] = (384, 192)
    """Hidden layers of the policy, tanh; ``actor`` are the teacher's."""
