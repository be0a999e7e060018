"""A student that remembers where it has to aim, so that its hops come true on a leg it never met.

Its memory is an aim, added to the command that its network is told, at both ends of the range of
commands, and the command of late. A second network feels from the joints' past, while the foot
stands, how far the last hop was off; the aim adds up a share of that, as an integral controller
does. The network that feels learns from the true heights, the other one from a teacher
that is told the same aim.
"""

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch
from torch import nn
from torch.nn import functional

from hopping_leg.arrays import Array, BoolArray
from hopping_leg.envs.observation import CLEARANCE_GAIN, Observation
from hopping_leg.hop_detection import FLIGHT_CLEARANCE
from hopping_leg.rl.checkpoint import Tree
from hopping_leg.rl.distillation.students import Bools, DaggerBuffer, Wanted
from hopping_leg.rl.onnx_export import CommandIntegrator, Network
from hopping_leg.rl.sb3_policies import dense, dense_network, flatten, layer_weights

FROM, UNTIL = 0.03, 0.11
"""Time after touchdown in which a hop's error is told, s: its last samples have arrived, and the
foot still stands."""

_SHORTEST = 0.1
"""Shortest flight that counts as a hop, s."""


class HopErrors:
    """Follows flights tick by tick.

    Args:
        count: Legs.
        period: Length of a tick, s.

    Attributes:
        first: Ticks after touchdown from which on a hop's error is told.
        last: Ticks after touchdown until which it is.
    """

    def __init__(self, count: int, period: float) -> None:
        times = (_SHORTEST, FROM, UNTIL)
        self._shortest, self.first, self.last = (round(time / period) for time in times)
        self._flying = np.zeros(count, np.int64)
        self._standing = np.full(count, self.last)
        self._top = np.zeros(count)
        self._command = np.zeros(count)
        self._error = np.zeros(count)

    def see(self, height: Array, clearance: Array, command: Array, begun: BoolArray) -> Array:
        """Take in a tick; return what is told of the last hop in it.

        Args:
            height: Heights of the bases, any unit.
            clearance: Under the feet, m.
            command: In the heights' unit.
            begun: Whose episode began with this tick.

        Returns:
            Apex minus command in the ticks that tell it, 0 in all others and where the command has
            changed since the foot left the ground, (n,).
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
        tells = (self._standing >= self.first) & (self._standing < self.last)
        tells &= self._command == command
        return np.where(tells, self._error, 0.0)

    def state(self) -> Tree:
        """Return everything needed to go on."""
        arrays = {n: value for n, value in vars(self).items() if isinstance(value, np.ndarray)}
        return {name: value.copy() for name, value in arrays.items()}

    def restore(self, state: Tree) -> None:
        """Go on from a ``state``."""
        for name, value in state.items():
            setattr(self, name, np.array(value))


_NOTES = 3
"""Of every tick beside what is seen: aim, command of late, error that is told."""


@dataclass(frozen=True)
class CommandIntegratorConfig:
    """Numbers of the memory; heights are in half the range of commands."""

    share: float = 0.35
    """Share of a hop's error that is corrected."""
    farthest: float = 1.0
    """Largest aim."""
    beyond: float = 0.3
    """How far outside of the commands' range the network may be told."""
    late: float = 0.3
    """Time constant of the command of late, s: who sees it change does not believe the last hop."""
    start: float = 0.3
    """Aims with which episodes of the training begin."""
    scale: float = 0.2
    """Error that the network which feels shows as 1."""
    most: float = 3.0
    """Largest error that it shows."""


@dataclass(frozen=True)
class Places:
    """Where things stand in an observation."""

    measured: int
    """Entries that the student sees, the first ones."""
    size: int
    """All entries."""
    command: int
    """The measured command."""
    true_height: int
    """The base's height, normalised as the command is."""
    true_command: int
    """The command again."""
    true_clearance: int
    """The gap under the foot, times ``CLEARANCE_GAIN``."""


class AdaptiveStudent(nn.Module):
    """Acts on what is measured and on where it remembers to aim.

    Attributes:
        trust: Share of the legs whose aim follows what is felt; that of the others follows the
            truth.

    Args:
        places: Where things stand in an observation.
        hidden: Layers of the network that acts.
        feeling: Layers of the one that feels.
        room: Ticks from which it learns, the newest.
        legs: How many legs act at once.
        period: Control period, s.
        command_integrator: Numbers of the memory.
    """

    def __init__(
        self,
        places: Places,
        hidden: list[int],
        feeling: list[int],
        room: int,
        legs: int,
        period: float,
        command_integrator: CommandIntegratorConfig,
    ) -> None:
        super().__init__()
        self.command_integrator, self._places = command_integrator, places
        self.layers = dense(places.measured, hidden, nn.Tanh)
        self.layers.append(nn.Linear(hidden[-1], 2))
        self.feeling = dense(places.measured + 1, feeling, nn.Tanh)
        self.feeling.append(nn.Linear(feeling[-1], 1))
        self._watch = HopErrors(legs, period)
        self.rate = command_integrator.share / (self._watch.last - self._watch.first)
        """Share of what is felt in a tick by which the aim moves."""
        self.follow = 1 - math.exp(-period / command_integrator.late)
        """Share of its distance by which the command of late follows in a tick."""
        self.trust = 0.0
        self._memory = torch.zeros(legs, 3)
        self._notes: list[torch.Tensor] = []
        self._lessons = DaggerBuffer(room, places.size + _NOTES)

    def act(self, observation: torch.Tensor, begun: Bools) -> torch.Tensor:
        """Return what to do in a tick, and remember where to aim next."""
        seen, memory, command_integrator = (
            observation[:, : self._places.measured],
            self._memory,
            self.command_integrator,
        )
        fresh = torch.as_tensor(np.broadcast_to(begun, len(seen)).copy(), dtype=torch.bool)
        memory[fresh] = 0.0
        memory[fresh, :2] = command_integrator.start * (2 * torch.rand(int(fresh.sum()), 2) - 1)
        command = seen[:, self._places.command]
        shares = torch.stack([(1 - command) / 2, (1 + command) / 2], dim=1).clamp(0, 1)
        told = command + (shares * memory[:, :2]).sum(dim=1)
        aim = told.clamp(-1 - command_integrator.beyond, 1 + command_integrator.beyond) - command
        true = self._tell(observation, begun)
        with torch.no_grad():
            felt = (
                self._feel(seen, memory[:, 2]).clamp(
                    -command_integrator.most, command_integrator.most
                )
                * command_integrator.scale
            )
            action: torch.Tensor = self.layers(self._told(seen, aim))
        self._notes.append(torch.stack([aim, memory[:, 2], true / command_integrator.scale], dim=1))
        trusted = torch.arange(len(seen)) < round(self.trust * len(seen))
        moved = self.rate * torch.where(trusted, felt, true) / (shares**2).sum(dim=1)
        bound = command_integrator.farthest
        ends = (memory[:, :2] - moved[:, None] * shares).clamp(-bound, bound)
        late = memory[:, 2] + self.follow * (command - memory[:, 2])
        self._memory = torch.cat([ends, late[:, None]], dim=1)
        return action

    def _tell(self, observation: torch.Tensor, begun: Bools) -> torch.Tensor:
        """Return by how much the last hops were off, in the ticks that tell it, (n,)."""
        p = self._places
        columns = [p.true_height, p.true_clearance, p.true_command]
        height, clearance, command = observation[:, columns].double().numpy().T
        begun = np.broadcast_to(begun, len(observation))
        told = self._watch.see(height, clearance / CLEARANCE_GAIN, command, begun)
        return torch.from_numpy(told).float()

    def _feel(self, seen: torch.Tensor, late: torch.Tensor) -> torch.Tensor:
        shown: torch.Tensor = self.feeling(torch.cat([seen, late[:, None]], dim=1))[:, 0]
        return shown

    def _told(self, seen: torch.Tensor, aim: torch.Tensor) -> torch.Tensor:
        told = seen.clone()
        told[:, self._places.command] += aim
        return told

    def add_rollout(
        self, observations: npt.NDArray[np.float32], begun: Bools, known: Bools
    ) -> None:
        """Keep a rollout with what was noted in its ticks."""
        notes = torch.stack(self._notes).numpy()
        self._notes = []
        rows = np.concatenate([observations, notes], axis=2)
        self._lessons.add(rows, None if known.all() else known)

    def loss(self, count: int, wanted: Wanted) -> torch.Tensor:
        """Return the loss of both networks over ticks drawn at random."""
        rows = self._lessons.draw(count)
        observation, (aim, late, error) = rows[:, :-_NOTES], rows[:, -_NOTES:].T
        seen = observation[:, : self._places.measured]
        most = self.command_integrator.most
        felt = self._feel(seen, late)
        observation[:, self._places.true_command] += aim
        acted = functional.mse_loss(self.layers(self._told(seen, aim)), wanted(observation))
        return acted + functional.mse_loss(felt, error.clamp(-most, most))

    def network(self, observation: Observation) -> Network:
        """Return both networks and the memory of where to aim."""
        network = dense_network([self.layers], observation, "clip")
        layers = [layer_weights(m) for m in flatten(self.feeling) if isinstance(m, nn.Linear)]
        order = np.append(observation.order, observation.size)
        layers[0] = (layers[0][0][:, order], layers[0][1])
        config = self.command_integrator
        memory = CommandIntegrator(
            layers,
            rate=self.rate * config.scale,
            most=config.most,
            farthest=config.farthest,
            beyond=config.beyond,
            follow=self.follow,
        )
        return dataclasses.replace(network, memory=memory)

    def state(self) -> Tree:
        """Return the lessons, the memory and what was seen of the last hops."""
        return {
            "lessons": self._lessons.state(),
            "memory": self._memory.numpy().copy(),
            "watch": self._watch.state(),
        }

    def restore(self, state: Tree) -> None:
        """Go on from a ``state``."""
        self._lessons.restore(state["lessons"])
        self._memory = torch.from_numpy(state["memory"].copy())
        self._watch.restore(state["watch"])
