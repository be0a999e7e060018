"""A policy that tries a little off what it would do: gSDE, without torch.

Generalised state-dependent exploration adds the last hidden layer, times a random matrix that is
held for a while, to the action before the squash. That layer is an output of the graph here.
"""

import numpy as np
import onnxruntime

from hopping_leg.arrays import Array
from hopping_leg.controllers.observation_history import make_observation_history
from hopping_leg.controllers.policy import Card
from hopping_leg.controllers.protocol import Measurement
from hopping_leg.rl.hidden import PREFIX, expose_hidden

EDGE = 0.995
"""Largest action: exploration and gradients end where tanh is flat."""


class ExploringPolicy:
    """Acts as a policy file does, and off it; implements ``Controller``.

    Args:
        content: The policy file.
        card: Its card.
        spread: Standard deviation of the random matrix, (hidden, 2).
        hold: Ticks for which a matrix is held.
        rng: Source of randomness.
    """

    def __init__(
        self, content: bytes, card: Card, spread: Array, hold: int, rng: np.random.Generator
    ) -> None:
        self.name = f"exploring {card.recipe}"
        self._layout = make_observation_history(card.layout, 1 / card.rate)
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        self._session = onnxruntime.InferenceSession(
            expose_hidden(content), options, providers=["CPUExecutionProvider"]
        )
        hidden = [o.name for o in self._session.get_outputs() if o.name.startswith(PREFIX)]
        self._wanted = ["torque", hidden[-1]]
        self._scale = np.array(card.torque_scale)
        self._spread, self._hold, self._rng = spread, hold, rng

    def reset(self, count: int) -> None:
        """Forget everything."""
        self._layout.reset(count)
        self._torque = np.zeros((count, 2))
        self._left = 0

    def act(self, measurement: Measurement) -> Array:
        """Return joint torques, N m, (n, 2)."""
        self._layout.update(measurement, self._torque)
        torque, hidden = self._session.run(self._wanted, self._layout.inputs())
        if self._left == 0:
            shape = (len(torque), *self._spread.shape)
            self._matrix = self._rng.standard_normal(shape) * self._spread
            self._left = self._hold
        self._left -= 1
        action = np.clip(torque.astype(np.float64) / self._scale, -EDGE, EDGE)
        off = np.einsum("nh,nha->na", hidden.astype(np.float64), self._matrix)
        self._torque = np.tanh(np.arctanh(action) + off) * self._scale
        return self._torque

    def internals(self) -> dict[str, Array]:
        """Return nothing."""
        return {}
