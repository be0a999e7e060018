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
    begun: BoolArray
    """Whether an episode began with the tick, (ticks, n)."""
    memory: Array32
    """What the student remembered before the first tick, (n, k)."""


class Sequences(NamedTuple):
    """Whole rollouts of some environments."""

    observations: torch.Tensor
    """(ticks, b, size)."""
    labels: torch.Tensor
    """(ticks, b, 2)."""
    valid: torch.Tensor
    """Which ticks come before the first new episode, (ticks, b)."""
    memory: torch.Tensor
    """(b, k)."""


class RolloutBuffer:
    """A ring of rollouts, observations in half precision.

    Args:
        rollouts: Rollouts kept.
        ticks: Control periods of each.
        count: Environments n.
        size: Entries of an observation.
        memory: Entries of the student's memory.
    """

    def __init__(self, rollouts: int, ticks: int, count: int, size: int, memory: int) -> None:
        shape = (max(rollouts, 1), ticks, count)
        self._observations = torch.zeros((*shape, size), dtype=torch.float16)
        self._labels = torch.zeros((*shape, 2), dtype=torch.float16)
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
        self._valid[place] = torch.from_numpy(~np.logical_or.accumulate(later))
        self._memory[place] = torch.from_numpy(rollout.memory * ~rollout.begun[0][:, None])
        self.added += 1

    def ticks(self, count: int, generator: torch.Generator) -> tuple[torch.Tensor, torch.Tensor]:
        """Return observations, (b, size), and labels, (b, 2), of ``count`` ticks at random."""
        held = self.filled * self._valid[0].numel()
        rows = torch.randint(held, (count,), generator=generator)
        observations = self._observations.view(-1, self._observations.shape[-1])
        return observations[rows].float(), self._labels.view(-1, 2)[rows].float()

    def sequences(self, count: int, generator: torch.Generator) -> Sequences:
        """Return a rollout at random, of as many environments as give ``count`` ticks."""
        place = int(torch.randint(self.filled, (), generator=generator))
        ticks, legs = self._valid[place].shape
        chosen = torch.randperm(legs, generator=generator)[: max(1, count // ticks)]
        return Sequences(
            self._observations[place][:, chosen].float(),
            self._labels[place][:, chosen].float(),
            self._valid[place][:, chosen],
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


_ARRAYS = ("observations", "labels", "valid", "memory")
