"""A reward as a list of terms, each a function of a ``Transition`` with a name and a weight."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from hopping_leg import errors, hop_detection
from hopping_leg.arrays import Array, BoolArray, IntArray, Stateful


@dataclass
class Transition:
    """True state after a tick of n legs and the actions around it.

    The arrays are live: they change with the next tick, so keep copies. Those of the state have one
    column after the other in memory, as numpy is slow on rows of two.
    """

    height: Array
    """Base height x, m, (n,)."""
    rate: Array
    """Base velocity, m/s, (n,)."""
    q: Array
    """Joint positions, rad, (n, 2)."""
    qd: Array
    """Joint velocities, rad/s, (n, 2)."""
    command: Array
    """Desired height x^d in force during the tick, m, (n,)."""
    action: Array
    """Action of this tick, in [-1, 1], (n, 2)."""
    last_action: Array
    """Action of the tick before, zero at the start of an episode, (n, 2)."""
    torque: Array
    """What the motors gave, mean over the tick, N m, (n, 2)."""
    apex: BoolArray
    """Whether the base passed an in-flight apex during the tick, (n,)."""
    apex_height: Array
    """Height of that apex, else NaN, m, (n,)."""
    measure_clearance: Callable[[], Array]
    """Computes ``foot_clearance`` for the terms that need it."""

    @cached_property
    def foot_clearance(self) -> Array:
        """Gap between foot and ground, m, (n,)."""
        return self.measure_clearance()

    @cached_property
    def flying(self) -> BoolArray:
        """Whether the foot is off the ground, (n,)."""
        return self.foot_clearance >= hop_detection.FLIGHT_CLEARANCE


def sum_of_joints(values: Array) -> Array:
    """Return the sum over hip and knee, (n,), of (n, 2), in a third of the time of ``np.sum``."""
    return values[:, 0] + values[:, 1]


class LastingTerm(Stateful):
    """A term that remembers something, see ``STATE``, or changes in training."""

    def __call__(self, transition: Transition) -> Array | float:
        """Return the unweighted term, (n,), or one number for all."""
        raise NotImplementedError

    def restart(self, rows: IntArray) -> None:
        """Forget the past of some legs, whose episodes begin anew; nothing, if never called."""

    def anneal(self, share: float) -> None:
        """Adapt to the share of the training that is done, 0 to 1."""


class RewardTerm(NamedTuple):
    """A line of a reward."""

    name: str
    """Name in ``info``, after ``reward_``."""
    weight: float | Callable[[float], float]
    """Factor of the term, negative for a penalty, or that factor at a share of the training."""
    function: Callable[[Transition], Array | float]
    """Computes the unweighted term, (n,), or one number for all; may be a ``LastingTerm``."""


class Reward:
    """The scaled sum of k weighted terms; UsageError says that two have the same name."""

    def __init__(self, terms: Sequence[RewardTerm], scale: float = 1.0) -> None:
        self.terms, self.scale = tuple(terms), scale
        self.names = tuple(term.name for term in terms)
        self._functions = tuple(term.function for term in terms)
        if len(set(self.names)) < len(self.names):
            raise errors.UsageError(f"Terms of a reward need names of their own, not {self.names}.")
        self._lasting = {t.name: t.function for t in terms if isinstance(t.function, LastingTerm)}
        self.anneal(0.0)

    def with_terms(self, *terms: RewardTerm) -> "Reward":
        """Return the same reward with more terms at its end."""
        return Reward((*self.terms, *terms), self.scale)

    def anneal(self, share: float) -> None:
        """Adapt weights and terms to the share of the training that is done, 0 to 1."""
        weights = [weight(share) if callable(weight) else weight for _, weight, _ in self.terms]
        self._weights = self.scale * np.array(weights, np.float64)
        for term in self._lasting.values():
            term.anneal(share)

    def __call__(self, transition: Transition) -> tuple[Array, Array]:
        """Return the reward, (n,), and its unweighted terms, (n, k)."""
        terms = np.empty((len(transition.height), len(self.terms)))
        for column, term in enumerate(self._functions):
            terms[:, column] = term(transition)
        return np.vecdot(terms, self._weights), terms

    def restart(self, rows: IntArray) -> None:
        """Forget the past of some legs, whose episodes begin anew."""
        for term in self._lasting.values():
            term.restart(rows)

    def state(self) -> dict[str, Any]:
        """Return what the terms remember from tick to tick, by their names."""
        return {name: term.state() for name, term in self._lasting.items()}

    def restore(self, state: dict[str, Any]) -> None:
        """Go on from a ``state``."""
        for name, term in self._lasting.items():
            term.restore(state[name])
