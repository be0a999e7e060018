"""Show how a training goes: a live bar on a terminal, a line a minute elsewhere."""

import time
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

_LINE_SECONDS = 60.0


class TrainingProgress:
    """Live numbers of a training, as a context manager.

    Args:
        title: What is trained.
        quiet: Show nothing.
    """

    def __init__(self, title: str, *, quiet: bool = False) -> None:
        self._console = Console(stderr=True, quiet=quiet)
        self._title = title
        self._bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(bar_width=20),
            TextColumn("{task.percentage:>3.0f} %"),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            TextColumn("{task.fields[note]}"),
            console=self._console,
            disable=not self._console.is_terminal,
        )
        self._task = self._bar.add_task(title, total=1.0, note="")
        self._next_line = 0.0
        self._began = time.monotonic()
        self._first_steps: int | None = None

    def update(self, share: float, steps: int, hops: int, error: float, best: str) -> None:
        """Show the state of the training.

        Args:
            share: Of the budget that is used, 0 to 1.
            steps: Control steps so far.
            hops: Hops so far.
            error: Mean |apex - command| of the latest hops, m.
            best: About the best snapshot.
        """
        if self._first_steps is None:
            self._first_steps = steps
        passed = max(time.monotonic() - self._began, 1e-9)
        rate = (steps - self._first_steps) / passed
        note = f"{hops} hops · apex error {1000 * error:.0f} mm · {rate:.0f} steps/s{best}"
        self._bar.update(self._task, completed=share, note=note)
        if not self._console.is_terminal and passed >= self._next_line:
            self._next_line = passed + _LINE_SECONDS
            self._console.print(f"{self._title} {100 * share:.0f} % · {note}", soft_wrap=True)

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
