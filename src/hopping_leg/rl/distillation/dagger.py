"""How a student learns from a teacher, and where the teacher aims."""

from dataclasses import dataclass

import torch

from hopping_leg.arrays import Array
from hopping_leg.rl.checkpoint import Tree

_OUTLIER = 0.01
"""Error beyond which a hop counts no more, m: those after a new command miss by far."""

_FARTHEST = 0.2
"""Largest correction of the aim, of half the range of commands: where hops cannot be as low or high
as the command, no aim helps."""


@dataclass(frozen=True)
class DaggerConfig:
    """Numbers of the student's learning."""

    buffer_size: int = 600_000
    """Ticks of its past from which it learns, the newest."""
    gradient_steps: int = 256
    """Gradient steps after every rollout."""
    batch_size: int = 1024
    """Ticks per gradient step."""
    knots: int = 8
    """Heights at which the teacher's aim is corrected."""
    correction_rate: float = 0.1
    """Share of the recent hops' mean error by which a rollout corrects the aim."""


class CommandCorrection:
    """How much higher than the command the teacher is told, so that the student's hops come true.

    A student sees less than its teacher and hops lower or higher on average; what it is off at a
    height is added up there, as an integral controller does.

    Args:
        offset: Command that an observation shows as 0, m.
        gain: Its scale, 1/m.
        knots: Heights at which it is known, from -1 to 1 of an observation; linear in between.
    """

    def __init__(self, offset: float, gain: float, knots: int) -> None:
        self._offset, self._gain = offset, gain
        self._knots = torch.linspace(-1, 1, knots)
        self.values = torch.zeros(knots)
        """At the knots, of half the range of commands, (knots,)."""

    def correct(self, commands: Array, errors: Array, rate: float) -> None:
        """Aim lower where hops were too high.

        Args:
            commands: Of recent hops, m.
            errors: Apex minus command, m.
            rate: Share of the mean error that is corrected.
        """
        if not len(errors):
            return
        seen = torch.from_numpy((commands - self._offset) * self._gain).float()
        shares = _shares(seen, self._knots)
        off = torch.from_numpy(errors.clip(-_OUTLIER, _OUTLIER) * self._gain).float()
        self.values -= rate * (shares.T @ off) / shares.sum(dim=0).clamp(min=1.0)
        self.values.clamp_(-_FARTHEST, _FARTHEST)

    def __call__(self, command: torch.Tensor) -> torch.Tensor:
        """Return what the teacher is told at commands as observed, (n,)."""
        return command + _shares(command, self._knots) @ self.values

    def state(self) -> Tree:
        """Return where it aims."""
        return {"values": self.values.numpy().copy()}

    def restore(self, state: Tree) -> None:
        """Go on from a ``state``."""
        self.values = torch.from_numpy(state["values"].copy())


def _shares(command: torch.Tensor, knots: torch.Tensor) -> torch.Tensor:
    """Return the weights of knots at commands, (n, knots); they add up to 1."""
    spacing = knots[1] - knots[0]
    distance = (command.clamp(-1, 1)[:, None] - knots).abs()
    return (1 - distance / spacing).clamp(min=0.0)
