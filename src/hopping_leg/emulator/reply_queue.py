"""What is on its way to the host: frames and noise, each due at a time."""

import heapq
import itertools
from dataclasses import dataclass

from hopping_leg.emulator.frames import Frame


@dataclass(frozen=True)
class QueuedReply:
    """One thing that arrives at the host.

    Attributes:
        frame: From a drive; None for noise.
        noise: A line that is no frame.
        flip: Which bits flip on a serial line, any number from 0; negative for none. A CAN
            controller discards such a frame.
    """

    frame: Frame | None = None
    noise: bytes = b""
    flip: int = -1


class ReplyQueue:
    """Things in the order in which they are due; equal times keep their order."""

    def __init__(self) -> None:
        self._heap: list[tuple[float, int, QueuedReply]] = []
        self._numbers = itertools.count()

    def put(self, due: float, item: QueuedReply) -> None:
        """Add something that is due at a time, s."""
        heapq.heappush(self._heap, (due, next(self._numbers), item))

    def take(self, time: float) -> list[QueuedReply]:
        """Remove and return what is due at a time, s."""
        items = []
        while self._heap and self._heap[0][0] <= time:
            items.append(heapq.heappop(self._heap)[2])
        return items

    def next_due(self) -> float | None:
        """Return when the next thing is due, s; None if nothing waits."""
        return self._heap[0][0] if self._heap else None
