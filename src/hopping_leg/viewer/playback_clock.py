"""How fast shown time passes: pause, single steps, slow motion, and whether it keeps up."""

from collections import deque

SPEEDS = (0.02, 0.05, 0.1, 0.25, 0.5, 1.0, 2.0)
"""Shown seconds per second that can be chosen."""

LONGEST = 0.1
"""Seconds that are made up for after a stall; more is left out."""

_WINDOW = 2.0


class PlaybackClock:
    """Turns time on the wall into time to be shown, in whole ticks of so many seconds."""

    def __init__(self, tick: float) -> None:
        self.speed, self.paused = 1.0, False
        self._tick = tick
        self._steps = 0
        self._owed = 0.0
        self._past: deque[tuple[float, float]] = deque()
        self._wall = self._shown = 0.0

    def step(self, ticks: int = 1) -> None:
        """Pause, and show that many ticks more."""
        self.paused = True
        self._steps += ticks

    def due(self, elapsed: float) -> float:
        """Return how much time to show, s, given the time on the wall since the last call, s."""
        ticks = self._steps
        self._steps = 0
        if self.paused:
            self._owed = 0.0
            self._past.clear()
            return ticks * self._tick
        self._owed += min(elapsed, LONGEST) * self.speed
        ticks += int(self._owed / self._tick + 1e-9)
        self._owed = max(self._owed - ticks * self._tick, 0.0)
        self._wall += elapsed
        self._shown += ticks * self._tick
        self._past.append((self._wall, self._shown))
        while self._wall - self._past[0][0] > _WINDOW:
            self._past.popleft()
        return ticks * self._tick

    @property
    def real_time(self) -> float:
        """Shown over due time in the last two seconds: 1 keeps up, NaN while paused."""
        if len(self._past) < 2:
            return float("nan")
        wall, shown = self._past[0]
        return (self._shown - shown) / (self._wall - wall) / self.speed

    def set_speed(self, speed: float) -> None:
        """Go on at another speed."""
        self.speed = speed
        self._past.clear()
