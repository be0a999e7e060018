"""How a student learns from a teacher, and where the teacher aims."""

from dataclasses import dataclass

import torch

from hopping_leg.arrays import Array, IntArray
from hopping_leg.learn.checkpoint import Tree

_OUTLIER = 0.01
"""Error beyond which a hop counts no more, m: those after a new command miss by far."""

_FARTHEST = 0.2
"""Largest correction of the aim, of half the range of commands: where hops cannot be as low or high
as the command, no aim helps."""


_FARTHEST_OWN = 0.1
"""The same of a leg's own. What the policy cannot tell apart must not add up."""


@dataclass(frozen=True)
class Imitation:
    """Numbers of the student's learning."""

    memory: int = 600_000
    """Ticks of its past from which it learns, the newest."""
    updates: int = 256
    """Gradient steps after every rollout."""
    batch: int = 1024
    """Ticks per gradient step."""
    knots: int = 8
    """Heights at which the teacher's aim is corrected."""
    aiming: float = 0.1
    """Share of the recent hops' mean error by which a rollout corrects the aim."""
    aiming_own: float = 0.1
    """Share of a hop's error by which it corrects its own leg's aim, where legs differ."""


class Aim:
    """How much higher than the command the teacher is told, so that the student's hops come true.

    A student sees less than its teacher and hops lower or higher on average; what it is off at a
    height is added up there, as an integral controller does. Where legs differ from the one that
    the teacher knows, it is off on each of them in its own way, which is added up as well.

    Args:
        offset: Command that an observation shows as 0, m.
        gain: Its scale, 1/m.
        knots: Heights at which it is known, from -1 to 1 of an observation; linear in between.
        legs: How many legs differ.
    """

    def __init__(self, offset: float, gain: float, knots: int, legs: int = 0) -> None:
        self._offset, self._gain = offset, gain
        self._knots, self._ends = torch.linspace(-1, 1, knots), torch.linspace(-1, 1, 2)
        self.values = torch.zeros(knots)
        """For all legs at the knots, of half the range of commands, (knots,)."""
        self.own = torch.zeros(legs, 2)
        """On top of that for each at both ends of the range, (legs, 2)."""

    def correct(self, commands: Array, errors: Array, rate: float) -> None:
        """Aim lower where hops were too high.

        Args:
            commands: Of recent hops, m.
            errors: Apex minus command, m.
            rate: Share of the mean error that is corrected.
        """
        if not len(errors):
            return
        shares = _shares(self._seen(commands), self._knots)
        off = self._off(errors)
        self.values -= rate * (shares.T @ off) / shares.sum(dim=0).clamp(min=1.0)
        self.values.clamp_(-_FARTHEST, _FARTHEST)

    def correct_own(self, legs: IntArray, commands: Array, errors: Array, rate: float) -> None:
        """Aim lower on those legs whose hops were too high.

        Args:
            legs: Whose the hops were.
            commands: Of the hops, m.
            errors: Apex minus command, m.
            rate: Share of an error that is corrected.
        """
        change = -rate * self._off(errors)[:, None] * _shares(self._seen(commands), self._ends)
        self.own.index_add_(0, torch.from_numpy(legs), change)
        self.own.clamp_(-_FARTHEST_OWN, _FARTHEST_OWN)

    def __call__(self, command: torch.Tensor, legs: torch.Tensor | None = None) -> torch.Tensor:
        """Return what the teacher is told at commands as observed, (n,), of some legs, (n,)."""
        told = command + _shares(command, self._knots) @ self.values
        if len(self.own) and legs is not None:
            told = told + (_shares(command, self._ends) * self.own[legs]).sum(dim=1)
        return told

    def _seen(self, commands: Array) -> torch.Tensor:
        return torch.from_numpy((commands - self._offset) * self._gain).float()

    def _off(self, errors: Array) -> torch.Tensor:
        return torch.from_numpy(errors.clip(-_OUTLIER, _OUTLIER) * self._gain).float()

    def state(self) -> Tree:
        """Return where it aims."""
        return {"values": self.values.numpy().copy(), "own": self.own.numpy().copy()}

    def restore(self, state: Tree) -> None:
        """Go on from a ``state``."""
        self.values = torch.from_numpy(state["values"].copy())
        self.own = torch.from_numpy(state["own"].copy())


def _shares(command: torch.Tensor, knots: torch.Tensor) -> torch.Tensor:
    """Return the weights of knots at commands, (n, knots); they add up to 1."""
    spacing = knots[1] - knots[0]
    distance = (command.clamp(-1, 1)[:, None] - knots).abs()
    return (1 - distance / spacing).clamp(min=0.0)
