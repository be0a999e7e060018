"""What a student has seen lately, in half precision: far finer than the noise in it."""

from collections import deque
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import torch

from hopping_leg.rl.checkpoint import Tree


class DaggerBuffer:
    """The newest observations, each on its own.

    Args:
        room: How many are kept.
        size: Entries of an observation.
    """

    def __init__(self, room: int, size: int) -> None:
        self._seen = torch.zeros((room, size), dtype=torch.float16)
        self._next = self._count = 0

    def add(
        self, observations: npt.NDArray[np.float32], known: npt.NDArray[np.bool_] | None = None
    ) -> None:
        """Keep a rollout's observations in the place of the oldest.

        Args:
            observations: (ticks, n, size).
            known: For which it is known what to do, (ticks, n); None for all.
        """
        size = observations.shape[2]
        chosen = slice(None) if known is None else torch.from_numpy(known.reshape(-1))
        rows = torch.from_numpy(observations).reshape(-1, size)[chosen]
        places = (self._next + torch.arange(len(rows))) % len(self._seen)
        self._seen[places] = rows.half()
        self._next = int(places[-1]) + 1
        self._count = min(self._count + len(rows), len(self._seen))

    def draw(self, count: int) -> torch.Tensor:
        """Return some of them at random, (count, size)."""
        return self._seen[torch.randint(self._count, (count,))].float()

    def state(self) -> Tree:
        """Return everything that is kept."""
        return {"seen": self._seen[: self._count].numpy(), "next": self._next}

    def restore(self, state: Tree) -> None:
        """Go on from a ``state``."""
        self._next, self._count = state["next"], len(state["seen"])
        self._seen[: self._count] = torch.from_numpy(state["seen"])


class Drawn(NamedTuple):
    """Sequences of some legs out of a rollout."""

    seen: torch.Tensor
    """Observations, (ticks, b, size)."""
    counts: torch.Tensor
    """Which of them are before the first new episode and have a known answer, (ticks, b)."""
    memory: torch.Tensor
    """What was remembered before the first tick, (b, k)."""


class SequenceBuffer:
    """The newest rollouts, each leg's ticks in their order.

    Args:
        room: Ticks that are kept, rounded down to whole rollouts, but at least one.
    """

    def __init__(self, room: int) -> None:
        self._room = room
        self._rollouts: deque[tuple[torch.Tensor, torch.Tensor, torch.Tensor]] = deque()

    def add(
        self,
        observations: npt.NDArray[np.float32],
        begun: npt.NDArray[np.bool_],
        known: npt.NDArray[np.bool_],
        memory: torch.Tensor,
    ) -> None:
        """Keep a rollout and forget those for which there is no more room.

        Args:
            observations: (ticks, n, size).
            begun: Whose episode began with a tick, (ticks, n).
            known: For which it is known what to do, (ticks, n).
            memory: What was remembered before the first tick, (n, k).
        """
        seen = torch.from_numpy(observations).half()
        later = begun.copy()
        later[0] = False
        counts = known & ~np.logical_or.accumulate(later)
        fresh = torch.from_numpy(begun[0])[:, None]
        self._rollouts.append((seen, torch.from_numpy(counts), memory * ~fresh))
        most = max(1, self._room // begun.size)
        while len(self._rollouts) > most:
            self._rollouts.popleft()

    def draw(self, count: int) -> Drawn:
        """Return about so many ticks of a rollout at random."""
        seen, counts, memory = self._rollouts[int(torch.randint(len(self._rollouts), ()))]
        ticks, legs = counts.shape
        chosen = torch.randperm(legs)[: max(1, count // ticks)]
        return Drawn(seen[:, chosen].float(), counts[:, chosen], memory[chosen])

    def state(self) -> Tree:
        """Return everything that is kept."""
        return {"rollouts": [[part.numpy() for part in rollout] for rollout in self._rollouts]}

    def restore(self, state: Tree) -> None:
        """Go on from a ``state``."""
        self._rollouts = deque(
            (torch.from_numpy(seen), torch.from_numpy(counts), torch.from_numpy(memory))
            for seen, counts, memory in state["rollouts"]
        )
