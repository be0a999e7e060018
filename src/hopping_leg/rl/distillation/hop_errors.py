"""How far each leg's last hop was off, read from the true state: for what learns to feel it."""

import numpy as np

from hopping_leg.arrays import Array, BoolArray
from hopping_leg.hop_detection import FLIGHT_CLEARANCE
from hopping_leg.rl.checkpoint import Tree

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
            height: Of the bases, any unit.
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
