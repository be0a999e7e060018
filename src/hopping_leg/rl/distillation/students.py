"""Networks that learn to act like a teacher: on a window of the past, or with a memory.

Both act tick by tick for many legs and learn by regression on what the teacher would have done.
"""

from collections import deque
from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np
import torch
from torch import nn
from torch.nn import functional

from hopping_leg.arrays import Array32, BoolArray
from hopping_leg.envs.observation import Observation
from hopping_leg.rl import onnx_export, sb3_policies
from hopping_leg.rl.checkpoint import Tree


class DaggerBuffer:
    """The newest observations, ``room`` rows of ``size`` entries."""

    def __init__(self, room: int, size: int) -> None:
        self._seen = torch.zeros((room, size), dtype=torch.float16)
        self._next = self._count = 0

    def add(self, observations: Array32, known: BoolArray) -> None:
        """Keep a rollout's observations, (ticks, n, size), in the place of the oldest.

        Only those are kept for which it is known what to do, (ticks, n).
        """
        size = observations.shape[2]
        chosen = slice(None) if known.all() else torch.from_numpy(known.reshape(-1))
        rows = torch.from_numpy(observations).reshape(-1, size)[chosen]
        places = (self._next + torch.arange(len(rows))) % len(self._seen)
        self._seen[places] = rows.half()
        self._next = int(places[-1]) + 1
        self._count = min(self._count + len(rows), len(self._seen))

    def sample(self, count: int) -> torch.Tensor:
        """Return some of them at random, (count, size)."""
        return self._seen[torch.randint(self._count, (count,))].float()

    def state(self) -> Tree:
        """Return everything that is kept."""
        return {"seen": self._seen[: self._count].numpy(), "next": self._next}

    def restore(self, state: Tree) -> None:
        """Go on from a ``state``."""
        self._next, self._count = state["next"], len(state["seen"])
        self._seen[: self._count] = torch.from_numpy(state["seen"])


class SequenceBatch(NamedTuple):
    """Sequences of some legs out of a rollout."""

    seen: torch.Tensor
    """Observations, (ticks, b, size)."""
    counts: torch.Tensor
    """Which of them are before the first new episode and have a known answer, (ticks, b)."""
    memory: torch.Tensor
    """What was remembered before the first tick, (b, k)."""


class SequenceBuffer:
    """The newest rollouts, whole and at least one: ``room`` ticks, each leg's in their order."""

    def __init__(self, room: int) -> None:
        self._room = room
        self._rollouts: deque[tuple[torch.Tensor, torch.Tensor, torch.Tensor]] = deque()

    def add(
        self,
        observations: Array32,
        begun: BoolArray,
        known: BoolArray,
        memory: torch.Tensor,
    ) -> None:
        """Keep a rollout, (ticks, n, ...), and forget those for which there is no more room.

        ``memory`` is what was remembered before the first tick, (n, k).
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

    def sample(self, count: int) -> SequenceBatch:
        """Return about so many ticks of a rollout at random."""
        seen, counts, memory = self._rollouts[int(torch.randint(len(self._rollouts), ()))]
        ticks, legs = counts.shape
        chosen = torch.randperm(legs)[: max(1, count // ticks)]
        return SequenceBatch(seen[:, chosen].float(), counts[:, chosen], memory[chosen])

    def state(self) -> Tree:
        """Return everything that is kept."""
        return {"rollouts": [[part.numpy() for part in rollout] for rollout in self._rollouts]}

    def restore(self, state: Tree) -> None:
        """Go on from a ``state``."""
        self._rollouts = deque(
            (torch.from_numpy(seen), torch.from_numpy(counts), torch.from_numpy(memory))
            for seen, counts, memory in state["rollouts"]
        )


Wanted = Callable[[torch.Tensor], torch.Tensor]
"""From observations, (n, size), to what the teacher would do, (n, 2)."""


class Student(Protocol):
    """What a policy's student can do."""

    def act(self, observation: torch.Tensor, begun: BoolArray) -> torch.Tensor:
        """Return what to do in a tick, unbounded, (n, 2); ``begun`` tells new episodes, (n,)."""
        ...

    def add_rollout(self, observations: Array32, begun: BoolArray, known: BoolArray) -> None:
        """Keep a rollout, (ticks, n, ...), and where it is known what the teacher would do."""
        ...

    def loss(self, count: int, wanted: Wanted) -> torch.Tensor:
        """Return the mean squared difference to the teacher over about so many kept ticks."""
        ...

    def network(self, observation: Observation) -> onnx_export.Network:
        """Return it as it stands with the task's normalisation, for the observation's layout."""
        ...

    def state(self) -> Tree:
        """Return what it remembers beside its weights."""
        ...

    def restore(self, state: Tree) -> None:
        """Go on from a ``state``."""
        ...


class WindowStudent(nn.Module):
    """Dense layers on what is measured; what it has to remember must be in there.

    It sees the first ``measured`` entries of ``size``, and learns from the newest ``room`` ticks.
    """

    def __init__(
        self, measured: int, size: int, hidden: list[int], room: int, activation: type[nn.Module]
    ) -> None:
        super().__init__()
        self._measured = measured
        self.layers = sb3_policies.dense(measured, hidden, activation)
        self.layers.append(nn.Linear(hidden[-1], 2))
        self._buffer = DaggerBuffer(room, size)

    def act(self, observation: torch.Tensor, begun: BoolArray) -> torch.Tensor:
        """Return what to do in a tick; no tick depends on another."""
        action: torch.Tensor = self.layers(observation[:, : self._measured])
        return action

    def add_rollout(self, observations: Array32, begun: BoolArray, known: BoolArray) -> None:
        """Keep a rollout, tick by tick."""
        self._buffer.add(observations, known)

    def loss(self, count: int, wanted: Wanted) -> torch.Tensor:
        """Return the loss over ticks drawn at random."""
        seen = self._buffer.sample(count)
        return functional.mse_loss(self.layers(seen[:, : self._measured]), wanted(seen))

    def network(self, observation: Observation) -> onnx_export.Network:
        """Return its dense layers."""
        return sb3_policies.dense_network([self.layers], observation, "clip")

    def state(self) -> Tree:
        """Return the buffer."""
        return {"lessons": self._buffer.state()}

    def restore(self, state: Tree) -> None:
        """Go on from a ``state``."""
        self._buffer.restore(state["lessons"])


class RecurrentStudent(nn.Module):
    """A gated recurrent unit (GRU, Cho et al. 2014), which decides itself what to remember.

    Learns by backpropagation through the ticks of whole rollouts, from what it remembered then.
    Sees the first ``measured`` entries of an observation; ``room`` ticks are kept.
    """

    def __init__(self, measured: int, memory: int, room: int, legs: int) -> None:
        super().__init__()
        self._measured = measured
        self.unit = nn.GRU(measured, memory)
        self.readout = nn.Linear(memory, 2)
        self._memory = torch.zeros(legs, memory)
        self._before = self._memory.clone()
        self._buffer = SequenceBuffer(room)

    def act(self, observation: torch.Tensor, begun: BoolArray) -> torch.Tensor:
        """Return what to do in a tick and remember it."""
        self._memory[torch.as_tensor(begun, dtype=torch.bool)] = 0.0
        with torch.no_grad():
            _, memory = self.unit(observation[None, :, : self._measured], self._memory[None])
        self._memory = memory[0]
        action: torch.Tensor = self.readout(self._memory)
        return action

    def add_rollout(self, observations: Array32, begun: BoolArray, known: BoolArray) -> None:
        """Keep a rollout with what was remembered when it began."""
        self._buffer.add(observations, begun, known, self._before)
        self._before = self._memory.clone()

    def loss(self, count: int, wanted: Wanted) -> torch.Tensor:
        """Return the loss over some legs' sequences, each up to its first new episode."""
        seen, counts, memory = self._buffer.sample(count)
        remembered, _ = self.unit(seen[..., : self._measured], memory[None])
        acted = self.readout(remembered[counts])
        return functional.mse_loss(acted, wanted(seen[counts]))

    def network(self, observation: Observation) -> onnx_export.Network:
        """Return its recurrent unit and readout."""
        with torch.no_grad():
            weights = [w.double().numpy().copy() for w in self.unit.all_weights[0]]
        weights[0] = weights[0][:, observation.order]
        scaling, memory = observation.scaling, onnx_export.RecurrentUnit(*weights)
        layers = [sb3_policies.layer_weights(self.readout)]
        return onnx_export.Network(
            scaling.offset, scaling.gain, layers, "tanh", "clip", memory=memory
        )

    def state(self) -> Tree:
        """Return memory and buffer."""
        return {
            "memory": self._memory.numpy().copy(),
            "before": self._before.numpy().copy(),
            "lessons": self._buffer.state(),
        }

    def restore(self, state: Tree) -> None:
        """Go on from a ``state``."""
        self._memory = torch.from_numpy(state["memory"].copy())
        self._before = torch.from_numpy(state["before"].copy())
        self._buffer.restore(state["lessons"])
