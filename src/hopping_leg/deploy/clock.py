"""Time as the loop sees it, so that tests can replace it."""

import time
from typing import Protocol


class Clock(Protocol):
    """A monotonic clock, s."""

    def now(self) -> float:
        """Return the time."""
        ...

    def wait_until(self, deadline: float) -> float:
        """Return at a deadline, or at once if it is over; returns the time."""
        ...

    def patience(self, until: float) -> float:
        """Return how many of the computer's seconds something due at a time is worth waiting."""
        ...


class RealClock:
    """The computer's clock: sleeps until shortly before a deadline and spins for the rest.

    Args:
        spin: Time to spin, s.
    """

    def __init__(self, spin: float = 2e-4) -> None:
        self._spin = spin

    def now(self) -> float:
        """Return the time."""
        return time.monotonic()

    def wait_until(self, deadline: float) -> float:
        """Return at a deadline; returns the time."""
        pause = deadline - time.monotonic() - self._spin
        if pause > 0:
            time.sleep(pause)
        while (now := time.monotonic()) < deadline:
            pass
        return now

    def patience(self, until: float) -> float:
        """Return the time that is left."""
        return max(until - time.monotonic(), 0.0)
