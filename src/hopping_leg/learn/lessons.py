"""What a student has seen lately, in half precision: far finer than the noise in it."""

from collections import deque

import numpy as np
import numpy.typing as npt
import torch

from hopping_leg.learn.checkpoint import Tree


class Lessons:
    """The newest observations, each on its own.

    Args:
        room: How many are kept.
        size: Entries of an observation.
    """

    def __init__(self, room: int, size: int) -> None:
        self._seen = torch.zeros((room, size), dtype=torch.float16)
        self._next = self._count = 0

    def add(self, observations: npt.NDArray[np.float32]) -> None:
        """Keep observations, (..., size), in the place of the oldest."""
        rows = torch.from_numpy(observations).reshape(-1, self._seen.shape[1])
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


class Sequences:
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
        memory: torch.Tensor,
    ) -> None:
        """Keep a rollout and forget those for which there is no more room.

        Args:
            observations: (ticks, n, size).
            begun: Whose episode began with a tick, (ticks, n).
            memory: What was remembered before the first tick, (n, k).
        """
        self._rollouts.append(
            (
                torch.from_numpy(observations).half(),
                torch.from_numpy(begun.astype(np.bool_)),
                memory.clone(),
            )
        )
        most = max(1, self._room // begun.size)
        while len(self._rollouts) > most:
            self._rollouts.popleft()

    def draw(self, count: int) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Return about so many ticks of a rollout at random, as sequences of some of its legs.

        Returns:
            Observations, (ticks, b, size), whose episodes began, (ticks, b), and memories before
            the first tick, (b, k), zero where an episode began with that.
        """
        seen, begun, memory = self._rollouts[int(torch.randint(len(self._rollouts), ()))]
        ticks, legs = begun.shape
        chosen = torch.randperm(legs)[: max(1, count // ticks)]
        kept = memory[chosen] * ~begun[0, chosen, None]
        return seen[:, chosen].float(), begun[:, chosen], kept

    def state(self) -> Tree:
        """Return everything that is kept."""
        return {"rollouts": [[part.numpy() for part in rollout] for rollout in self._rollouts]}

    def restore(self, state: Tree) -> None:
        """Go on from a ``state``."""
        self._rollouts = deque(
            (torch.from_numpy(seen), torch.from_numpy(begun), torch.from_numpy(memory))
            for seen, begun, memory in state["rollouts"]
        )
