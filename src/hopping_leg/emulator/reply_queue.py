"""What is on its way to the host, in the order in which it is due."""

import heapq
import itertools
from dataclasses import dataclass
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
        self._heap: list[tuple[float, int, Item]] = []
        self._numbers = itertools.count()

    def put(self, due: float, item: Item) -> None:
        """Add something that is due at a time, s."""
        heapq.heappush(self._heap, (due, next(self._numbers), item))

    def take(self, time: float) -> list[Item]:
        """Remove and return what is due at a time, s."""
        items = []
        while self._heap and self._heap[0][0] <= time:
            items.append(heapq.heappop(self._heap)[2])
        return items

    def next_due(self) -> float | None:
        """Return when the next thing is due, s; None if nothing waits."""
        return self._heap[0][0] if self._heap else None
