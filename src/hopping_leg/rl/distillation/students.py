"""Networks that learn to act like a teacher: on a window of the past, or with a memory.

Both act tick by tick for many legs and learn by regression on what the teacher would have done.
"""

from collections.abc import Callable
from typing import Protocol

import numpy as np
import numpy.typing as npt
import torch
from torch import nn
from torch.nn import functional

from hopping_leg.rl.checkpoint import Tree
from hopping_leg.rl.distillation.buffers import DaggerBuffer, SequenceBuffer
from hopping_leg.rl.sb3_policies import dense

Bools = npt.NDArray[np.bool_]

Wanted = Callable[[torch.Tensor], torch.Tensor]
"""From observations, (n, size), to what the teacher would do, (n, 2)."""


class Student(Protocol):
    """What a policy's student can do."""

    def act(self, observation: torch.Tensor, begun: Bools) -> torch.Tensor:
        """Return what to do in a tick, unbounded, (n, 2).

        Args:
            observation: (n, size); only what learns may look beyond what is measured.
            begun: Whose episode began with this tick, (n,).
        """
        ...

    def add_rollout(
        self, observations: npt.NDArray[np.float32], begun: Bools, known: Bools
    ) -> None:
        """Keep a rollout.

        Args:
            observations: (ticks, n, size).
            begun: Whose episode began with a tick, (ticks, n).
            known: For which it is known what the teacher would do, (ticks, n).
        """
        ...

    def loss(self, count: int, wanted: Wanted) -> torch.Tensor:
        """Return the mean squared difference to the teacher over about so many kept ticks."""
        ...

    def state(self) -> Tree:
        """Return what it remembers beside its weights."""
        ...

    def restore(self, state: Tree) -> None:
        """Go on from a ``state``."""
        ...


class WindowStudent(nn.Module):
    """Dense layers on what is measured; what it has to remember must be in there.

    Args:
        measured: Entries of an observation that it sees, the first ones.
        size: Entries of an observation.
        hidden: Its layers.
        room: Ticks from which it learns, the newest.
        activation: Of the hidden layers.
    """

    def __init__(
        self, measured: int, size: int, hidden: list[int], room: int, activation: type[nn.Module]
    ) -> None:
        super().__init__()
        self._measured = measured
        self.layers = dense(measured, hidden, activation)
        self.layers.append(nn.Linear(hidden[-1], 2))
        self._lessons = DaggerBuffer(room, size)

    def act(self, observation: torch.Tensor, begun: Bools) -> torch.Tensor:
        """Return what to do in a tick; no tick depends on another."""
        action: torch.Tensor = self.layers(observation[:, : self._measured])
        return action

    def add_rollout(
        self, observations: npt.NDArray[np.float32], begun: Bools, known: Bools
    ) -> None:
        """Keep a rollout, tick by tick."""
        self._lessons.add(observations, None if known.all() else known)

    def loss(self, count: int, wanted: Wanted) -> torch.Tensor:
        """Return the loss over ticks drawn at random."""
        seen = self._lessons.draw(count)
        return functional.mse_loss(self.layers(seen[:, : self._measured]), wanted(seen))

    def state(self) -> Tree:
        """Return the lessons."""
        return {"lessons": self._lessons.state()}

    def restore(self, state: Tree) -> None:
        """Go on from a ``state``."""
        self._lessons.restore(state["lessons"])


class RecurrentStudent(nn.Module):
    """A gated recurrent unit (GRU, Cho et al. 2014), which decides itself what to remember.

    Learns by backpropagation through the ticks of whole rollouts, from what it remembered then.

    Args:
        measured: Entries of an observation that it sees, the first ones.
        memory: Entries of its memory.
        room: Ticks from which it learns, the newest.
        legs: How many legs act at once.
    """

    def __init__(self, measured: int, memory: int, room: int, legs: int) -> None:
        super().__init__()
        self._measured = measured
        self.unit = nn.GRU(measured, memory)
        self.readout = nn.Linear(memory, 2)
        self._memory = torch.zeros(legs, memory)
        self._before = self._memory.clone()
        self._lessons = SequenceBuffer(room)

    def act(self, observation: torch.Tensor, begun: Bools) -> torch.Tensor:
        """Return what to do in a tick and remember it."""
        self._memory[torch.as_tensor(begun, dtype=torch.bool)] = 0.0
        with torch.no_grad():
            _, memory = self.unit(observation[None, :, : self._measured], self._memory[None])
        self._memory = memory[0]
        action: torch.Tensor = self.readout(self._memory)
        return action

    def add_rollout(
        self, observations: npt.NDArray[np.float32], begun: Bools, known: Bools
    ) -> None:
        """Keep a rollout with what was remembered when it began."""
        self._lessons.add(observations, begun, known, self._before)
        self._before = self._memory.clone()

    def loss(self, count: int, wanted: Wanted) -> torch.Tensor:
        """Return the loss over some legs' sequences, each up to its first new episode."""
        seen, counts, memory = self._lessons.draw(count)
        remembered, _ = self.unit(seen[..., : self._measured], memory[None])
        acted = self.readout(remembered[counts])
        return functional.mse_loss(acted, wanted(seen[counts]))

    def state(self) -> Tree:
        """Return memory and lessons."""
        return {
            "memory": self._memory.numpy().copy(),
            "before": self._before.numpy().copy(),
            "lessons": self._lessons.state(),
        }

    def restore(self, state: Tree) -> None:
        """Go on from a ``state``."""
        self._memory = torch.from_numpy(state["memory"].copy())
        self._before = torch.from_numpy(state["before"].copy())
        self._lessons.restore(state["lessons"])
