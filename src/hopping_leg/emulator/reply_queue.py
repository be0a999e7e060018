"""What is on its way to the host, in the order in which it is due."""

import bisect
import math
from dataclasses import dataclass
from operator import itemgetter
from typing import Generic, TypeVar

from hopping_leg.deploy.frames import Frame

Item = TypeVar("Item")


@dataclass(frozen=True)
class QueuedReply:
    """One thing that arrives at the host."""

    frame: Frame | None = None
    """From a drive; None for noise."""
    noise: bytes = b""
    """A line that is no frame."""
    flip: int = -1
    """Which bits flip on a serial line, any number from 0; negative for none. A CAN controller
    discards such a frame."""


class TimedQueue(Generic[Item]):
    """Things in the order in which they are due; equal times keep their order."""

    def __init__(self) -> None:
        self._waiting: list[tuple[float, Item]] = []

    def put(self, due: float, item: Item) -> None:
        """Add something that is due at a time, s."""
        bisect.insort(self._waiting, (due, item), key=itemgetter(0))

    def take(self, time: float) -> list[Item]:
        """Remove and return what is due at a time, s."""
        due = bisect.bisect(self._waiting, time, key=itemgetter(0))
        items, self._waiting = self._waiting[:due], self._waiting[due:]
        return [item for _, item in items]

    def next_due(self) -> float:
        """Return when the next thing is due, s; infinite if nothing waits."""
        return self._waiting[0][0] if self._waiting else math.inf
