"""How a study goes: a live bar on a terminal, elsewhere a line for every job and minute."""

from collections.abc import Sequence

from hopping_leg.progress import LiveProgress, minutes


class Board(LiveProgress):
    """Shows which jobs run and how much is left, as a context manager.

    Args:
        total: Sum of all jobs' weights.
        own_bars: Jobs draw bars of their own; then there is a line per job instead of a bar.
    """

    def __init__(self, total: float, *, own_bars: bool = False) -> None:
        super().__init__("transfer", total, lines=True if own_bars else None)
        self._total, self._old, self._new, self._begun = total, 0.0, 0.0, 0.0

    def begin(self, name: str) -> None:
        """Say that a job begins in this process."""
        self._line(self._told(name))

    def finish(self, name: str, weight: float, *, new: bool = True) -> None:
        """Count a job; one that is not new was done by an earlier run."""
        self._begun = 0.0
        if new:
            self._new += weight
            self._line(self._told(f"done: {name}"))
        else:
            self._old += weight
        self._bar.update(self._task, completed=self._done)

    def show(self, notes: Sequence[str], begun: float = 0.0) -> None:
        """Show what runs now.

        Args:
            notes: One per running job.
            begun: Weight of what is done of them.
        """
        self._begun = begun
        self._bar.update(self._task, completed=self._done)
        note = " · ".join([*notes, self._time_left()])
        self._bar.update(self._task, note=note)
        self._line_if_due(self._told(note))

    @property
    def _done(self) -> float:
        return self._old + self._new + self._begun

    def _time_left(self) -> str:
        new, left = self._new + self._begun, self._total - self._done
        return f"about {minutes(self.passed / new * left)} left" if new and left > 0 else ""

    def _told(self, text: str) -> str:
        return f"{100 * self._done / max(self._total, 1e-9):.0f} % · {text}"
