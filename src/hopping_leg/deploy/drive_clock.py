"""When a reply was measured, by the drive's own millisecond counter (register 0x070).

The adapter may deliver a reply late, and the client library takes it as the answer to the next
question. The counter tells: the smallest difference between arrival and counter seen so far is that
of a reply that was not held up.
"""

_WRAP = 1 << 32
_HALF = 1 << 31
_DRIFT = 2e-4
"""Most that two clocks drift apart, s/s: both are quartzes."""

_RESTART = -500
"""A counter that falls back further than this, ms, began anew: no reply is held up so long."""

_SLACK = 0.0015
"""A reply may seem this much older than its question, s: the counter's step and drift."""


class DriveClock:
    """Dates the replies of one drive."""

    def __init__(self) -> None:
        self._counter: int | None = None
        self._time = 0.0
        self._offset = 0.0
        self._updated = 0.0

    def date(self, counter: int, arrived: float) -> float | None:
        """Return when a reply was measured, s on the host's clock.

        Args:
            counter: Of the drive, ms; wraps after 49 days.
            arrived: On the host's clock, s.

        Returns:
            None for a reply that has been seen before.
        """
        if self._counter is None:
            return self._begin(counter, arrived)
        step = (counter - self._counter + _HALF) % _WRAP - _HALF
        if step < _RESTART:
            return self._begin(counter, arrived)
        if step == 0:
            return None
        time = self._time + step * 1e-3
        if step > 0:
            self._counter, self._time = counter, time
        allowance = _DRIFT * (arrived - self._updated)
        self._offset, self._updated = min(self._offset + allowance, arrived - time), arrived
        return time + self._offset

    def _begin(self, counter: int, arrived: float) -> float:
        self._counter, self._time = counter, counter % _WRAP * 1e-3
        self._offset, self._updated = arrived - self._time, arrived
        return arrived

    @staticmethod
    def fresh(taken: float, asked: float) -> bool:
        """Tell whether a reply answers a question rather than an earlier one.

        Args:
            taken: When it was measured, s.
            asked: When the question left, s.
        """
        return taken >= asked - _SLACK
