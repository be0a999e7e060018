"""Networks that learn to act like a teacher, and the rollouts that they learn from."""

from abc import abstractmethod
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
import torch
from stable_baselines3.common.torch_layers import create_mlp
from torch import nn

from hopping_leg.arrays import Array32, BoolArray
from hopping_leg.envs.hidden_state import ERROR_GAIN, MISSED
from hopping_leg.envs.observation import Observation
from hopping_leg.rl.checkpoint import Tree
from hopping_leg.rl.onnx_export import Actor, DenseActor

_MOST_SHIFT = 0.06
"""Largest correction of a command, over the leg's length."""


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
    """What the student remembered before the first tick, (1, n, m)."""


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
        shape, half = (max(rollouts, 1), ticks, count), torch.float16
        self._arrays = {
            "observations": torch.zeros((*shape, size), dtype=half),
            "labels": torch.zeros((*shape, 2), dtype=half),
            "weights": torch.zeros(shape, dtype=half),
            "hidden": torch.zeros((*shape, hidden), dtype=half),
            "valid": torch.zeros(shape, dtype=torch.bool),
            "memory": torch.zeros((shape[0], count, memory)),
        }
        self.added = 0
        """Rollouts added so far."""

    @property
    def filled(self) -> int:
        """Rollouts held."""
        return min(self.added, len(self._arrays["valid"]))

    def add(self, rollout: LabelledRollout) -> None:
        """Keep a rollout in the place of the oldest."""
        place = self.added % len(self._arrays["valid"])
        later = rollout.begun.copy()
        later[0] = False
        memory = rollout.memory[0] * ~rollout.begun[0][:, None]
        new = rollout._asdict() | {"valid": ~np.logical_or.accumulate(later), "memory": memory}
        for name, array in self._arrays.items():
            array[place] = torch.from_numpy(new[name])
        self.added += 1

    def ticks(self, count: int, generator: torch.Generator) -> Batch:
        """Return ``count`` ticks at random."""
        seen, labels, weights, hidden, valid, memory = self._arrays.values()
        rows = torch.randint(self.filled * valid[0].numel(), (count,), generator=generator)
        parts = (part.flatten(0, 2)[rows].float() for part in (seen, labels, weights, hidden))
        return Batch._make([*parts, memory[0, :0]])

    def sequences(self, count: int, generator: torch.Generator) -> Batch:
        """Return a rollout at random, of as many environments as give ``count`` ticks."""
        place = int(torch.randint(self.filled, (), generator=generator))
        seen, labels, weights, hidden, valid, memory = (a[place] for a in self._arrays.values())
        ticks, legs = valid.shape
        chosen = torch.randperm(legs, generator=generator)[: max(1, count // ticks)]
        parts = (part[:, chosen].float() for part in (seen, labels, weights * valid, hidden))
        return Batch._make([*parts, memory[chosen]])

    def state(self) -> Tree:
        """Return everything that is held."""
        arrays = {name: array[: self.filled] for name, array in self._arrays.items()}
        return {"added": self.added, **arrays}

    def restore(self, state: Tree) -> None:
        """Go on from a ``state``."""
        self.added = state["added"]
        for name, array in self._arrays.items():
            array[: self.filled] = state[name]


@dataclass(frozen=True)
class StudentConfig:
    """Network of the policy."""

    memory: Literal["window", "gru"] = "window"
    """What it remembers: the samples that the observation shows, or a gated recurrent unit's
    state besides."""
    hidden: tuple[int, ...] = (256, 128)
    """Hidden layers, tanh, on what is seen and remembered."""
    size: int = 128
    """Entries of the recurrent unit's memory."""
    update_every: int = 1
    """Control periods between two updates of the recurrent unit."""
    correction: float = 0.0
    """Share by which the command is shifted, at every update, against what the student guesses that
    its last hop missed; only on legs that differ, and only once it is trained."""

    def make(self, observation: Observation, unseen: int = 0) -> "Student":
        """Build the untrained student of an observation and of numbers that it cannot see."""
        if self.memory == "gru":
            return RecurrentStudent(self, observation, unseen)
        return WindowStudent(observation.size, list(self.hidden))


class Student(Actor):
    """A network that can be taught."""

    correction: float = 0.0
    """Gain of a correction of the command, see ``StudentConfig``."""

    @abstractmethod
    def recall(
        self, buffer: RolloutBuffer, count: int, generator: torch.Generator
    ) -> tuple[Batch, torch.Tensor, torch.Tensor]:
        """Return about ``count`` ticks, and its actions and guesses of what is hidden there."""


class WindowStudent(DenseActor, Student):
    """Dense layers on what is measured; what it has to remember must be in there."""

    def __init__(self, inputs: int, hidden: list[int]) -> None:
        super().__init__(*create_mlp(inputs, 2, hidden, nn.Tanh))

    def recall(
        self, buffer: RolloutBuffer, count: int, generator: torch.Generator
    ) -> tuple[Batch, torch.Tensor, torch.Tensor]:
        """Return ticks drawn at random and its actions; it guesses nothing."""
        batch = buffer.ticks(count, generator)
        return batch, self.layers(batch.observations), batch.hidden


class RecurrentStudent(Student):
    """A gated recurrent unit (GRU, Cho et al. 2014), which decides itself what to remember.

    Dense layers see its memory and the observation in every control period; the unit is updated in
    every fourth, say, as the observation shows the periods between, so that there are fewer steps
    to learn through. It learns by backpropagation through whole rollouts, from what it remembered
    at their start; a second readout has to guess what it cannot see, so that it remembers what
    tells of that. Behind the unit's own, its memory has the control periods since an update and the
    shift of the command.

    Episodes must begin with an update: at multiples of ``update_every`` of a rollout's ticks.
    """

    direction: torch.Tensor

    def __init__(self, config: StudentConfig, observation: Observation, unseen: int) -> None:
        super().__init__()
        inputs, self._size = observation.size, config.size
        self.memory_size, self.every = config.size + 2, config.update_every
        self.correction = config.correction if unseen else 0.0
        self.unit = nn.GRU(inputs, config.size)
        layers = create_mlp(config.size + inputs, -1, list(config.hidden), nn.Tanh)
        self.layers = nn.Sequential(*layers)
        self.action = nn.Linear(config.hidden[-1], 2)
        self.guess = nn.Linear(config.hidden[-1], unseen) if unseen else None
        direction = torch.from_numpy(observation.command_direction.astype(np.float32))
        self.register_buffer("direction", direction, persistent=False)

    def forward(
        self, observation: torch.Tensor, memory: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the action and the next memory."""
        before, count, shift = torch.split(memory, [self._size, 1, 1], dim=-1)
        due, seen = (1 - count).clamp(0, 1), observation + shift * self.direction
        if torch.onnx.is_in_onnx_export() or bool(due.any()):
            _, updated = self.unit(seen[None], before[None].contiguous())
            before = before + due * (updated[0] - before)
        known = self.layers(torch.cat([before, seen], dim=-1))
        if self.guess is not None and self.correction:
            missed = self.guess(known)[:, MISSED, None] * (1 / ERROR_GAIN)
            shift = shift + self.correction * due * (missed - shift)
            shift = shift.clamp(-_MOST_SHIFT, _MOST_SHIFT)
        count = count + 1 - self.every * (count - self.every + 2).clamp(0, 1)
        return self.action(known), torch.cat([before, count, shift], dim=-1)

    def recall(
        self, buffer: RolloutBuffer, count: int, generator: torch.Generator
    ) -> tuple[Batch, torch.Tensor, torch.Tensor]:
        """Return whole rollouts of some environments, its actions and guesses."""
        batch = buffer.sequences(count, generator)
        seen, memory = batch.observations, batch.memory[None, :, : self._size]
        updated, _ = self.unit(seen[:: self.every], memory.contiguous())
        remembered = updated.repeat_interleave(self.every, dim=0)[: len(seen)]
        known = self.layers(torch.cat([remembered, seen], dim=-1))
        guesses = batch.hidden if self.guess is None else self.guess(known)
        return batch, self.action(known), guesses
