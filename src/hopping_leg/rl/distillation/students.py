"""Networks that learn to act like a teacher: on a window of the past, or with a memory."""

from abc import abstractmethod
from dataclasses import dataclass
from typing import Literal

import torch
from torch import nn
from torch.nn import functional

from hopping_leg.envs.observation import Observation
from hopping_leg.rl import onnx_export, sb3_policies
from hopping_leg.rl.distillation.buffer import RolloutBuffer


@dataclass(frozen=True)
class StudentConfig:
    """Network of the policy."""

    memory: Literal["window", "gru"] = "window"
    """What it remembers: the samples that the observation shows, or a gated recurrent unit's
    state."""
    hidden: tuple[int, ...] = (256, 128)
    """Hidden layers, tanh; the recurrent unit has none."""
    size: int = 128
    """Entries of the recurrent unit's memory."""

    def make(self, inputs: int) -> "Student":
        """Build the untrained student of so many inputs."""
        if self.memory == "gru":
            return RecurrentStudent(inputs, self.size)
        return WindowStudent(inputs, list(self.hidden))


class Student(nn.Module):
    """A network from observation and memory to an action."""

    memory_size: int
    """Entries k of its memory."""

    @abstractmethod
    def forward(
        self, observation: torch.Tensor, memory: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the action, unbounded, (n, 2), and the next memory, (n, k)."""

    @abstractmethod
    def loss(self, buffer: RolloutBuffer, count: int, generator: torch.Generator) -> torch.Tensor:
        """Return the mean squared difference to the labels of about ``count`` ticks."""

    @abstractmethod
    def network(self, observation: Observation) -> onnx_export.Network:
        """Return it as it stands, with the observation's normalisation."""


class WindowStudent(Student):
    """Dense layers on what is measured; what it has to remember must be in there."""

    memory_size = 0

    def __init__(self, inputs: int, hidden: list[int]) -> None:
        super().__init__()
        self.layers = sb3_policies.dense(inputs, hidden, nn.Tanh)
        self.layers.append(nn.Linear(hidden[-1], 2))

    def forward(
        self, observation: torch.Tensor, memory: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the action; nothing is remembered."""
        return self.layers(observation), memory

    def loss(self, buffer: RolloutBuffer, count: int, generator: torch.Generator) -> torch.Tensor:
        """Return the loss over ticks drawn at random."""
        observations, labels = buffer.ticks(count, generator)
        return functional.mse_loss(self.layers(observations), labels)

    def network(self, observation: Observation) -> onnx_export.Network:
        """Return its dense layers."""
        return sb3_policies.dense_network([self.layers], observation, "clip")


class RecurrentStudent(Student):
    """A gated recurrent unit (GRU, Cho et al. 2014), which decides itself what to remember.

    Learns by backpropagation through the ticks of whole rollouts, from what it remembered then.
    """

    def __init__(self, inputs: int, memory: int) -> None:
        super().__init__()
        self.memory_size = memory
        self.unit = nn.GRU(inputs, memory)
        self.readout = nn.Linear(memory, 2)

    def forward(
        self, observation: torch.Tensor, memory: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the action, a linear function of the next memory."""
        _, after = self.unit(observation[None], memory[None])
        return self.readout(after[0]), after[0]

    def loss(self, buffer: RolloutBuffer, count: int, generator: torch.Generator) -> torch.Tensor:
        """Return the loss over some environments' sequences, each up to its first new episode."""
        seen = buffer.sequences(count, generator)
        remembered, _ = self.unit(seen.observations, seen.memory[None])
        valid = seen.valid
        return functional.mse_loss(self.readout(remembered[valid]), seen.labels[valid])

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
