"""What rewards see of one tick, and the Reward protocol."""

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

from hopping_leg.arrays import Array, BoolArray


class Transition(NamedTuple):
    """True state after a tick of n legs and the actions around it.

    The arrays are live: they change with the next tick, so keep copies.
    """

    state: Array
    """Base height, hip and knee angle, and their rates, m, rad, m/s, rad/s, (n, 6)."""
    command: Array
    """Desired height x^d in force during the tick, m, (n,)."""
    action: Array
    """Action of this tick, in [-1, 1], (n, 2)."""
    last_action: Array
    """Action of the tick before, zero at the start of an episode, (n, 2)."""
    apex: BoolArray
    """Whether the base passed an in-flight apex during the tick, (n,)."""
    apex_height: Array
    """Height of that apex, else NaN, m, (n,)."""
    measure_clearance: Callable[[], Array]
    """Computes ``foot_clearance`` for the rewards that need it."""

    @property
    def height(self) -> Array:
        """Base height x, m, (n,)."""
        return self.state[:, 0]

    @property
    def rate(self) -> Array:
        """Base velocity, m/s, (n,)."""
        return self.state[:, 3]

    @property
    def q(self) -> Array:
        """Joint positions, rad, (n, 2)."""
        return self.state[:, 1:3]

    @property
    def qd(self) -> Array:
        """Joint velocities, rad/s, (n, 2)."""
        return self.state[:, 4:6]

    @property
    def foot_clearance(self) -> Array:
        """Gap between foot and ground, m, (n,)."""
        return self.measure_clearance()


class Reward(Protocol):
    """Judges one tick of every leg."""

    names: tuple[str, ...]
    """Of its terms, k in all."""

    def __call__(self, transition: Transition) -> tuple[Array, Array]:
        """Return the reward, (n,), and its terms, (n, k)."""
        ...

    def state(self) -> dict[str, Any]:
        """Return what it remembers from tick to tick, as arrays and plain values."""
        ...

    def restore(self, state: dict[str, Any]) -> None:
        """Go on from a ``state``."""
        ...
