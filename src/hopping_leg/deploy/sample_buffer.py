"""Samples of both joints by tick, and what a controller sees of them."""

import numpy as np

from hopping_leg.controllers.protocol import SAMPLES, Measurement
from hopping_leg.deploy.drive_link import Reply

REMEMBERED = 16
"""Ticks; older samples are forgotten."""


class SampleBuffer:
    """The recent past of both joints.

    A sample counts once both drives have sent it. Its age is that of the tick that asked for it,
    so that a sample of this tick has age zero, as in simulation; a reply that arrives late is put
    where it belongs, and a tick without one shows older samples with their ages.

    Args:
        period: Control period, s.
    """

    def __init__(self, period: float) -> None:
        self._period = period
        self._ticks: dict[int, list[Reply | None]] = {}
        self._commands: dict[int, float] = {}

    def put(self, tick: int, joint: int, reply: Reply) -> None:
        """Record a reply to a tick's question."""
        self._ticks.setdefault(tick, [None, None])[joint] = reply
        for old in [t for t in self._ticks if t <= tick - REMEMBERED]:
            del self._ticks[old]
            self._commands.pop(old, None)

    def complete(self) -> bool:
        """Tell whether any tick has both joints."""
        return any(None not in sample for sample in self._ticks.values())

    def measurement(self, tick: int, command: float) -> Measurement:
        """Return what a controller sees at a tick.

        Args:
            tick: Number of the tick.
            command: Desired height now, m.

        Raises:
            ValueError: No sample is complete.
        """
        self._commands[tick] = command
        whole = [t for t, sample in self._ticks.items() if None not in sample and t <= tick]
        newest = sorted(whole, reverse=True)[:SAMPLES]
        if not newest:
            raise ValueError("No tick has samples of both joints.")
        newest += [newest[-1]] * (SAMPLES - len(newest))
        chosen = [[reply for reply in self._ticks[t] if reply is not None] for t in newest]
        return Measurement(
            q=np.array([[[reply.position for reply in pair] for pair in chosen]]),
            qd=np.array([[[reply.velocity for reply in pair] for pair in chosen]]),
            command=np.array([[self._commands.get(t, command) for t in newest]]),
            age=np.array([[(tick - t) * self._period for t in newest]]),
        )
