"""Give a network another command, so that hops reach the desired height on average.

At a command c it is given c + a + b (c - m) / w, with m the middle and w half of the range of
commands. After every trial a and b move against the line through the errors of its hops, as an
integral controller does. The two numbers vanish in the scaling of the network's inputs: the file
is an ordinary policy.
"""

from dataclasses import dataclass, replace

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.controllers import observation_history, policy
from hopping_leg.rl.onnx_export import Network

_ROUNDS = 30
_NEAR = 1e-3
"""Errors below which all points weigh the same, m."""


def robust_line(x: Array, y: Array, doubt: float = 0.0) -> Array:
    """Return constant and slope of the line of least absolute deviations, (2,).

    ``doubt`` is as many points' worth of evidence that the slope is zero.
    """
    columns = np.stack([np.ones_like(x), x], axis=1)
    ridge = np.diag([1e-9, 1e-9 + doubt])
    weight = np.ones_like(y)
    for _ in range(_ROUNDS):
        weighted = columns * weight[:, None]
        line = np.linalg.solve(weighted.T @ columns + ridge, weighted.T @ y)
        weight = 1 / np.maximum(np.abs(y - columns @ line), _NEAR)
        weight *= len(y) / weight.sum()
    return np.asarray(line)


@dataclass(frozen=True)
class CommandCorrectionConfig:
    """How the correction follows the errors."""

    rate: float = 0.6
    """Share of a trial's error that is corrected."""
    ridge: float = 2.0
    """Hops' worth of doubt that the errors depend on the command at all."""
    farthest: float = 0.1
    """Largest correction at either end of the range, m."""


@dataclass(frozen=True)
class LinearCommandCorrection:
    """Commands that a network is given instead of the desired ones."""

    low: float
    """Lowest command, m."""
    high: float
    """Highest command, m."""
    shift: tuple[float, float] = (0.0, 0.0)
    """a and b, m."""

    def corrected(self, command: Array) -> Array:
        """Return what the network is given at commands, m, (...)."""
        given: Array = command + self._features(command) @ np.array(self.shift)
        return given

    def updated(
        self, command: Array, error: Array, options: CommandCorrectionConfig
    ) -> "LinearCommandCorrection":
        """Return the correction after hops at commands that missed by errors, m, (hops,)."""
        if not len(error):
            return self
        line = robust_line(self._features(command)[:, 1], error, options.ridge)
        a, b = np.array(self.shift) - options.rate * line
        most = options.farthest
        a = float(np.clip(a, -most, most))
        room = most - abs(a)
        return replace(self, shift=(a, float(np.clip(b, -room, room))))

    def applied(self, network: Network, card: policy.Card) -> Network:
        """Return a network that computes with the corrected command."""
        a, b = self.shift
        middle, half = (self.low + self.high) / 2, (self.high - self.low) / 2
        slope = 1 + b / half
        at = _command_columns(card)
        offset, gain = network.offset.copy(), network.gain.copy()
        offset[at] = (offset[at] - a + b / half * middle) / slope
        gain[at] = gain[at] * slope
        return replace(network, offset=offset, gain=gain)

    def _features(self, command: Array) -> Array:
        middle, half = (self.low + self.high) / 2, (self.high - self.low) / 2
        return np.stack([np.ones_like(command), (command - middle) / half], axis=-1)


def _command_columns(card: policy.Card) -> slice:
    """Return where commands stand among a policy's joined inputs."""
    shapes = observation_history.make_observation_history(card.layout, 1 / card.rate).shapes
    sizes = {name: int(np.prod(shape)) for name, shape in shapes.items()}
    first = sum(sizes[name] for name in list(sizes)[: list(sizes).index("command")])
    return slice(first, first + sizes["command"])
