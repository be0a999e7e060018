"""How far each leg's last hop was off, read from the true state: for what learns to feel it."""

import numpy as np

from hopping_leg.arrays import Array, BoolArray
from hopping_leg.rl.checkpoint import Tree

FROM, UNTIL = 6, 22
"""Ticks after touchdown in which a hop is told: its last samples have arrived, and the foot still
stands."""

_SHORTEST = 20
"""Ticks of a flight that counts as a hop."""

_CLEAR = 1e-4
"""Gap under a foot that flies, m."""


class HopWatch:
    """Follows flights tick by tick.

    Args:
        count: Legs.
    """

    def __init__(self, count: int) -> None:
        self._flying = np.zeros(count, np.int64)
        self._standing = np.full(count, UNTIL)
        self._top = np.zeros(count)
        self._command = np.zeros(count)
        self._error = np.zeros(count)

    def see(self, height: Array, clearance: Array, command: Array, begun: BoolArray) -> Array:
        """Take in a tick; return what is told of the last hop in it.

        Args:
            height: Of the bases, any unit.
            clearance: Under the feet, m.
            command: In the heights' unit.
            begun: Whose episode began with this tick.

        Returns:
            Apex minus command in the ticks that tell it, 0 in all others and where the command has
            changed since the foot left the ground, (n,).
        """
        self._flying[begun], self._standing[begun] = 0, UNTIL
        flies = clearance > _CLEAR
        left = flies & (self._flying == 0)
        landed = ~flies & (self._flying >= _SHORTEST)
        self._error = np.where(landed, self._top - self._command, self._error)
        self._standing = np.where(flies, UNTIL, np.where(landed, 0, self._standing + 1))
        self._top = np.where(left, height, np.maximum(self._top, height))
        self._command = np.where(left, command, self._command)
        self._flying = np.where(flies, self._flying + 1, 0)
        tells = (self._standing >= FROM) & (self._standing < UNTIL) & (self._command == command)
        return np.where(tells, self._error, 0.0)

    def state(self) -> Tree:
        """Return everything needed to go on."""
        return {name: value.copy() for name, value in vars(self).items()}

    def restore(self, state: Tree) -> None:
        """Go on from a ``state``."""
        for name, value in state.items():
            setattr(self, name, np.array(value))
