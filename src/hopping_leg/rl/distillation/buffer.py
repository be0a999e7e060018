"""What a student learns from: its newest rollouts, with what the teacher would have done."""

from typing import NamedTuple

import numpy as np
import torch

from hopping_leg.arrays import Array32, BoolArray
from hopping_leg.rl.checkpoint import Tree


class LabelledRollout(NamedTuple):
    """Some control periods of n environments."""

    observations: Array32
    """(ticks, n, size)."""
    labels: Array32
    """Actions of the teacher, (ticks, n, 2)."""
    weights: Array32
    """How much each label counts, (ticks, n)."""
    hidden: Array32
    """What the student cannot see and is asked for beside the action, (ticks, n, k or 0)."""
    begun: BoolArray
    """Whether an episode began with the tick, (ticks, n)."""
    memory: Array32
    """What the student remembered before the first tick, (n, m)."""


class Batch(NamedTuple):
    """Ticks at random, (b, ...), or whole rollouts of some environments, (ticks, b, ...)."""

    observations: torch.Tensor
    labels: torch.Tensor
    weights: torch.Tensor
    """Zero behind the first new episode of a rollout."""
    hidden: torch.Tensor
    memory: torch.Tensor
    """Before the first tick, (b, m); of no use to ticks at random."""


class RolloutBuffer:
    """A ring of rollouts, observations in half precision.

    Args:
        rollouts: Rollouts kept.
        ticks: Control periods of each.
        count: Environments n.
        size: Entries of an observation.
        memory: Entries of the student's memory.
        hidden: Entries of what it cannot see.
    """

    def __init__(
        self, rollouts: int, ticks: int, count: int, size: int, memory: int, hidden: int = 0
    ) -> None:
        shape = (max(rollouts, 1), ticks, count)
        self._observations = torch.zeros((*shape, size), dtype=torch.float16)
        self._labels = torch.zeros((*shape, 2), dtype=torch.float16)
        self._weights = torch.zeros(shape, dtype=torch.float16)
        self._hidden = torch.zeros((*shape, hidden), dtype=torch.float16)
        self._valid = torch.zeros(shape, dtype=torch.bool)
        self._memory = torch.zeros((shape[0], count, memory))
        self.added = 0
        """Rollouts added so far."""

    @property
    def filled(self) -> int:
        """Rollouts held."""
        return min(self.added, len(self._labels))

    def add(self, rollout: LabelledRollout) -> None:
        """Keep a rollout in the place of the oldest."""
        place = self.added % len(self._labels)
        later = rollout.begun.copy()
        later[0] = False
        self._observations[place] = torch.from_numpy(rollout.observations)
        self._labels[place] = torch.from_numpy(rollout.labels)
        self._weights[place] = torch.from_numpy(rollout.weights)
        self._hidden[place] = torch.from_numpy(rollout.hidden)
        self._valid[place] = torch.from_numpy(~np.logical_or.accumulate(later))
        self._memory[place] = torch.from_numpy(rollout.memory * ~rollout.begun[0][:, None])
        self.added += 1

    def ticks(self, count: int, generator: torch.Generator) -> Batch:
        """Return ``count`` ticks at random."""
        rows = torch.randint(self.filled * self._valid[0].numel(), (count,), generator=generator)
        parts = (self._observations, self._labels, self._weights[..., None], self._hidden)
        seen, labels, weights, hidden = (part.flatten(0, 2)[rows].float() for part in parts)
        return Batch(seen, labels, weights[:, 0], hidden, self._memory[0, :0])

    def sequences(self, count: int, generator: torch.Generator) -> Batch:
        """Return a rollout at random, of as many environments as give ``count`` ticks."""
        place = int(torch.randint(self.filled, (), generator=generator))
        ticks, legs = self._valid[place].shape
        chosen = torch.randperm(legs, generator=generator)[: max(1, count // ticks)]
        return Batch(
            self._observations[place][:, chosen].float(),
            self._labels[place][:, chosen].float(),
            (self._weights[place] * self._valid[place])[:, chosen].float(),
            self._hidden[place][:, chosen].float(),
            self._memory[place][chosen],
        )

    def state(self) -> Tree:
        """Return everything that is held."""
        arrays = {name: getattr(self, f"_{name}")[: self.filled].numpy() for name in _ARRAYS}
        return {"added": self.added, **arrays}

    def restore(self, state: Tree) -> None:
        """Go on from a ``state``."""
        self.added = state["added"]
        for name in _ARRAYS:
            getattr(self, f"_{name}")[: self.filled] = torch.from_numpy(state[name])


_ARRAYS = ("observations", "labels", "weights", "hidden", "valid", "memory")
