"""A student that remembers a correction of its command, so that it hops as high on other legs.

Its memory is the correction at both ends of the range of commands, and the delayed command. A
second network estimates the last hop's error from the joints' past, while the foot stands; the
correction integrates a share of that. The estimate is learnt from the true heights, the action from
a teacher whose command is corrected alike.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import nn
from torch.nn import functional

from hopping_leg.arrays import Array, Array32, BoolArray
from hopping_leg.envs.observation import CLEARANCE_GAIN, Observation
from hopping_leg.hop_detection import FLIGHT_CLEARANCE
from hopping_leg.rl import checkpoint, onnx_export, sb3_policies
from hopping_leg.rl.distillation.students import DaggerBuffer, Wanted

FROM, UNTIL = 0.03, 0.11
"""Time after touchdown in which a hop's error counts, s: its last samples have arrived, and the
foot still stands."""

_SHORTEST = 0.1
"""Shortest flight that counts as a hop, s."""


class HopErrors:
    """Errors of the last hops; they count from ``first`` to ``last`` ticks after touchdown."""

    def __init__(self, count: int, period: float) -> None:
        times = (_SHORTEST, FROM, UNTIL)
        self._shortest, self.first, self.last = (round(time / period) for time in times)
        self._flying = np.zeros(count, np.int64)
        self._standing = np.full(count, self.last)
        self._top = np.zeros(count)
        self._command = np.zeros(count)
        self._error = np.zeros(count)

    def update(self, height: Array, clearance: Array, command: Array, begun: BoolArray) -> Array:
        """Return apex minus command of the last hops in the ticks in which it counts, (n,).

        It is 0 in all others and where the command has changed since the foot left the ground.
        """
        self._flying[begun], self._standing[begun] = 0, self.last
        flies = clearance >= FLIGHT_CLEARANCE
        left = flies & (self._flying == 0)
        landed = ~flies & (self._flying >= self._shortest)
        self._error = np.where(landed, self._top - self._command, self._error)
        self._standing = np.where(flies, self.last, np.where(landed, 0, self._standing + 1))
        self._top = np.where(left, height, np.maximum(self._top, height))
        self._command = np.where(left, command, self._command)
        self._flying = np.where(flies, self._flying + 1, 0)
        counts = (self._standing >= self.first) & (self._standing < self.last)
        counts &= self._command == command
        return np.where(counts, self._error, 0.0)

    def state(self) -> checkpoint.Tree:
        """Return everything needed to go on."""
        arrays = {n: value for n, value in vars(self).items() if isinstance(value, np.ndarray)}
        return {name: value.copy() for name, value in arrays.items()}

    def restore(self, state: checkpoint.Tree) -> None:
        """Go on from a ``state``."""
        for name, value in state.items():
            setattr(self, name, np.array(value))


_NOTES = 3
"""Entries kept of every tick beside the observation: correction, delayed command, error."""


@dataclass(frozen=True)
class CommandIntegratorConfig:
    """Numbers of the memory; heights are in half the range of commands."""

    share: float = 0.35
    """Share of a hop's error that is corrected."""
    farthest: float = 1.0
    """Largest correction."""
    beyond: float = 0.3
    """Largest distance of the corrected command from the range of commands."""
    late: float = 0.3
    """Time constant of the delayed command, s: where it differs, the last hop says nothing."""
    start: float = 0.3
    """Largest correction with which episodes of the training begin."""
    scale: float = 0.2
    """Error that the estimating network gives as 1."""
    most: float = 3.0
    """Largest error that it gives."""


@dataclass(frozen=True)
class Places:
    """Columns of an observation."""

    measured: int
    """Entries that the student sees, the first ones."""
    size: int
    """Number of all entries."""
    command: int
    """Column of the measured command."""
    true_height: int
    """Column of the base's height, normalised as the command is."""
    true_command: int
    """Column of the true command."""
    true_clearance: int
    """Column of the gap under the foot, times ``CLEARANCE_GAIN``."""


class AdaptiveStudent(nn.Module):
    """Acts on what is measured, with the command that it remembers to correct.

    ``places`` are the observation's columns, ``error_hidden`` the layers that estimate the error;
    ``room`` ticks are learnt from, the newest. ``estimate_share`` of the legs follow the estimated
    error, the others the true one.
    """

    def __init__(
        self,
        places: Places,
        hidden: list[int],
        error_hidden: list[int],
        room: int,
        legs: int,
        period: float,
        command_integrator: CommandIntegratorConfig,
    ) -> None:
        super().__init__()
        self.command_integrator, self._places = command_integrator, places
        self.layers = sb3_policies.dense(places.measured, hidden, nn.Tanh)
        self.layers.append(nn.Linear(hidden[-1], 2))
        self.feeling = sb3_policies.dense(places.measured + 1, error_hidden, nn.Tanh)
        self.feeling.append(nn.Linear(error_hidden[-1], 1))
        self._watch = HopErrors(legs, period)
        self.rate = command_integrator.share / (self._watch.last - self._watch.first)
        """Share of the estimated error by which a tick changes the correction."""
        self.follow = 1 - math.exp(-period / command_integrator.late)
        """Share of its distance by which the delayed command follows in a tick."""
        self.estimate_share = 0.0
        self._memory = torch.zeros(legs, 3)
        self._notes: list[torch.Tensor] = []
        self._buffer = DaggerBuffer(room, places.size + _NOTES)

    def act(self, observation: torch.Tensor, begun: BoolArray) -> torch.Tensor:
        """Return what to do in a tick, and update the correction."""
        seen, memory = observation[:, : self._places.measured], self._memory
        o = self.command_integrator
        fresh = torch.as_tensor(np.broadcast_to(begun, len(seen)).copy(), dtype=torch.bool)
        memory[fresh] = 0.0
        memory[fresh, :2] = o.start * (2 * torch.rand(int(fresh.sum()), 2) - 1)
        command = seen[:, self._places.command]
        shares = torch.stack([(1 - command) / 2, (1 + command) / 2], dim=1).clamp(0, 1)
        corrected = command + (shares * memory[:, :2]).sum(dim=1)
        correction = corrected.clamp(-1 - o.beyond, 1 + o.beyond) - command
        true = self._true_error(observation, begun)
        with torch.no_grad():
            estimated = self._estimate(seen, memory[:, 2]).clamp(-o.most, o.most) * o.scale
            action: torch.Tensor = self.layers(self._corrected(seen, correction))
        self._notes.append(torch.stack([correction, memory[:, 2], true / o.scale], dim=1))
        by_estimate = torch.arange(len(seen)) < round(self.estimate_share * len(seen))
        moved = self.rate * torch.where(by_estimate, estimated, true) / (shares**2).sum(dim=1)
        ends = (memory[:, :2] - moved[:, None] * shares).clamp(-o.farthest, o.farthest)
        delayed = memory[:, 2] + self.follow * (command - memory[:, 2])
        self._memory = torch.cat([ends, delayed[:, None]], dim=1)
        return action

    def _true_error(self, observation: torch.Tensor, begun: BoolArray) -> torch.Tensor:
        """Return the errors of the last hops, in the ticks in which they count, (n,)."""
        p = self._places
        columns = [p.true_height, p.true_clearance, p.true_command]
        height, clearance, command = observation[:, columns].double().numpy().T
        begun = np.broadcast_to(begun, len(observation))
        errors = self._watch.update(height, clearance / CLEARANCE_GAIN, command, begun)
        return torch.from_numpy(errors).float()

    def _estimate(self, seen: torch.Tensor, delayed: torch.Tensor) -> torch.Tensor:
        error: torch.Tensor = self.feeling(torch.cat([seen, delayed[:, None]], dim=1))[:, 0]
        return error

    def _corrected(self, seen: torch.Tensor, correction: torch.Tensor) -> torch.Tensor:
        shown = seen.clone()
        shown[:, self._places.command] += correction
        return shown

    def add_rollout(self, observations: Array32, begun: BoolArray, known: BoolArray) -> None:
        """Keep a rollout with correction, delayed command and error of its ticks."""
        notes = torch.stack(self._notes).numpy()
        self._notes = []
        rows = np.concatenate([observations, notes], axis=2)
        self._buffer.add(rows, known)

    def loss(self, count: int, wanted: Wanted) -> torch.Tensor:
        """Return the loss of both networks over ticks drawn at random."""
        rows = self._buffer.sample(count)
        observation, (correction, delayed, error) = rows[:, :-_NOTES], rows[:, -_NOTES:].T
        seen = observation[:, : self._places.measured]
        most = self.command_integrator.most
        estimated = self._estimate(seen, delayed)
        observation[:, self._places.true_command] += correction
        action = self.layers(self._corrected(seen, correction))
        loss = functional.mse_loss(action, wanted(observation))
        return loss + functional.mse_loss(estimated, error.clamp(-most, most))

    def network(self, observation: Observation) -> onnx_export.Network:
        """Return both networks and the memory."""
        network = sb3_policies.dense_network([self.layers], observation, "clip")
        layers = [
            sb3_policies.layer_weights(m)
            for m in sb3_policies.flatten(self.feeling)
            if isinstance(m, nn.Linear)
        ]
        order = np.append(observation.order, observation.size)
        layers[0] = (layers[0][0][:, order], layers[0][1])
        config = self.command_integrator
        memory = onnx_export.CommandIntegrator(
            layers,
            rate=self.rate * config.scale,
            most=config.most,
            farthest=config.farthest,
            beyond=config.beyond,
            follow=self.follow,
        )
        return replace(network, memory=memory)

    def state(self) -> checkpoint.Tree:
        """Return the buffer, the memory and the last hops."""
        return {
            "lessons": self._buffer.state(),
            "memory": self._memory.numpy().copy(),
            "watch": self._watch.state(),
        }

    def restore(self, state: checkpoint.Tree) -> None:
        """Go on from a ``state``."""
        self._buffer.restore(state["lessons"])
        self._memory = torch.from_numpy(state["memory"].copy())
        self._watch.restore(state["watch"])
