"""What the loop needs of the other end: motors, emulated motors, or a test's fake."""

from dataclasses import dataclass
from typing import Protocol

from hopping_leg.deploy.observation import Outgoing, Replies, Reply


@dataclass(frozen=True, slots=True)
class Exchange:
    """What came back in a tick.

    Attributes:
        replies: Fresh ones: measured after this tick's question was asked.
        late: Drive (0 hip, 1 knee) and reply to an earlier tick that arrived now.
    """

    replies: Replies
    late: tuple[tuple[int, Reply], ...] = ()


class Link(Protocol):
    """The way to both drives; nothing of it ever waits beyond what the caller allows."""

    def exchange(self, outgoing: Outgoing, until: float) -> Exchange:
        """Tell both drives what to do and ask for their state in the same frames.

        Args:
            outgoing: What they shall do.
            until: When to stop waiting, s on the loop's clock.
        """
        ...

    def send(self, outgoing: Outgoing) -> None:
        """Tell both drives what to do; returns at once."""
        ...

    def close(self) -> None:
        """Give the adapter back."""
        ...
