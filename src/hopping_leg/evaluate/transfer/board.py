"""How a study goes: a live bar on a terminal, elsewhere a line for every job and minute."""

import time
from collections.abc import Sequence
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

_LINE_SECONDS = 60.0


class Board:
    """Shows which jobs run and how much is left, as a context manager.

    Args:
        total: Sum of all jobs' weights.
        own_bars: Jobs draw bars of their own; then there is a line per job instead of a bar.
    """

    def __init__(self, total: float, *, own_bars: bool = False) -> None:
        self._console = Console(stderr=True)
        self._total, self._old, self._new = total, 0.0, 0.0
        self._lines = own_bars or not self._console.is_terminal
        self._bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(bar_width=20),
            TextColumn("{task.percentage:>3.0f} %"),
            TimeElapsedColumn(),
            TextColumn("{task.fields[note]}"),
            console=self._console,
            disable=self._lines,
        )
        self._task = self._bar.add_task("transfer", total=total, note="")
        self._began = time.monotonic()
        self._next_line = 0.0

    def begin(self, name: str) -> None:
        """Say that a job begins in this process."""
        self._print(name)

    def finish(self, name: str, weight: float, *, new: bool = True) -> None:
        """Count a job; one that is not new was done by an earlier run."""
        if new:
            self._new += weight
            self._print(f"done: {name}")
        else:
            self._old += weight
        self._bar.update(self._task, completed=self._old + self._new)

    def show(self, notes: Sequence[str]) -> None:
        """Show what runs now."""
        note = " · ".join([*notes, self._time_left()])
        self._bar.update(self._task, note=note)
        if self._lines and time.monotonic() >= self._next_line:
            self._next_line = time.monotonic() + _LINE_SECONDS
            self._print(note)

    def _time_left(self) -> str:
        left = self._total - self._old - self._new
        if not self._new or left <= 0:
            return ""
        seconds = round((time.monotonic() - self._began) / self._new * left)
        return f"about {seconds // 60}:{seconds % 60:02d} left"

    def _print(self, text: str) -> None:
        if self._lines:
            share = 100 * (self._old + self._new) / max(self._total, 1e-9)
            self._console.print(f"{share:.0f} % · {text}", soft_wrap=True, highlight=False)

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
