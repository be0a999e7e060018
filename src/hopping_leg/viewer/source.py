"""What a viewer can show: something with legs whose time goes on."""

from typing import Protocol

from hopping_leg.viewer.tracks import Track


class Source(Protocol):
    """A live simulation, a replay, or a run on the real leg."""

    tracks: list[Track]
    """One per leg."""
    now: float
    """Time that is shown, s."""
    notices: list[str]
    """What the reader should be told; whoever shows them empties the list."""

    def advance(self, seconds: float) -> None:
        """Let time pass."""
        ...
