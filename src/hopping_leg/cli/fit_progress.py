"""Show how an identification goes: a live bar on a terminal, a line a minute elsewhere."""

import time
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

_LINE_SECONDS = 60.0


class FitProgress:
    """Stage, share done, time left and cost of a fit, as a context manager."""

    def __init__(self) -> None:
        self._console = Console(stderr=True)
        self._bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(bar_width=20),
            TextColumn("{task.percentage:>3.0f} %"),
            TimeElapsedColumn(),
            TextColumn("{task.fields[note]}"),
            console=self._console,
            disable=not self._console.is_terminal,
        )
        self._task = self._bar.add_task("preparing", total=1.0, note="")
        self._began = time.monotonic()
        self._next_line = _LINE_SECONDS

    def update(self, stage: str, share: float, cost: float) -> None:
        """Show the state of the fit.

        Args:
            stage: What is being done.
            share: Done of all, 0 to 1.
            cost: Lowest so far.
        """
        passed = time.monotonic() - self._began
        left = f" · at most {_minutes(passed * (1 - share) / share)} left" if 0 < share < 1 else ""
        note = f"cost {cost:.5g}{left}"
        self._bar.update(self._task, description=stage, completed=share, note=note)
        if not self._console.is_terminal and passed >= self._next_line:
            self._next_line = passed + _LINE_SECONDS
            self._console.print(f"{stage} {100 * share:.0f} % · {note}", soft_wrap=True)

    def __enter__(self) -> Self:
        """Start drawing."""
        self._bar.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Stop drawing."""
        self._bar.stop()


def _minutes(seconds: float) -> str:
    """Return a duration as m:ss."""
    whole = round(seconds)
    return f"{whole // 60}:{whole % 60:02d}"
