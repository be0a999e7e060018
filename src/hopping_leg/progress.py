"""How long work goes: a live bar on a terminal, a line now and then elsewhere."""

import time
from types import TracebackType
from typing import Self

from rich import progress

from hopping_leg.terminal import plain_console

_LINE_SECONDS = 30.0


class LiveProgress:
    """A bar with a note beside it, as a context manager; its heirs say what is noted.

    Args:
        title: What is done.
        total: When it is done.
        columns: Shown between the time passed and the note.
        quiet: Show nothing.
        lines: Write lines instead of a bar; None does so where there is no terminal.
        first_line: Time until the first line, s.
    """

    def __init__(
        self,
        title: str,
        total: float = 1.0,
        *,
        columns: tuple[progress.ProgressColumn, ...] = (),
        quiet: bool = False,
        lines: bool | None = None,
        first_line: float = 0.0,
    ) -> None:
        self._console = plain_console(stderr=True, quiet=quiet)
        self._lines = not self._console.is_terminal if lines is None else lines
        self._bar = progress.Progress(
            progress.TextColumn("{task.description}", markup=False),
            progress.BarColumn(bar_width=20),
            progress.TextColumn("{task.percentage:>3.0f} %"),
            progress.TimeElapsedColumn(),
            *columns,
            progress.TextColumn("{task.fields[note]}", markup=False),
            console=self._console,
            disable=self._lines,
        )
        self._task = self._bar.add_task(title, total=total, note="")
        self._began = time.monotonic()
        self._next_line = first_line

    @property
    def passed(self) -> float:
        """Time since the work began, s."""
        return time.monotonic() - self._began

    def _line(self, text: str) -> None:
        """Write a line now, where lines are written."""
        if self._lines:
            self._console.print(text, soft_wrap=True)

    def _line_if_due(self, text: str) -> None:
        """Write a line, where lines are written and the last one was long ago."""
        if self._lines and self.passed >= self._next_line:
            self._next_line = self.passed + _LINE_SECONDS
            self._line(text)

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


class ShareProgress(progress.Progress):
    """A bar per label that shows the share done, elapsed and remaining time."""

    def __init__(self) -> None:
        super().__init__(
            progress.TextColumn("{task.description}", markup=False),
            progress.BarColumn(),
            progress.TextColumn("{task.percentage:>3.0f}%"),
            progress.TimeElapsedColumn(),
            progress.TimeRemainingColumn(),
            console=plain_console(stderr=True),
        )

    def show(self, label: str, share: float, about: str = "") -> None:
        """Show the share done, 0 to 1, of what a label, and more about it, stands for."""
        label += about
        known = {task.description: task.id for task in self.tasks}
        task = known[label] if label in known else self.add_task(label, total=1.0)
        self.update(task, completed=share)

    def show_tick(self, label: str, ticks: int, done: int, _: object) -> None:
        """Show how many of so many ticks are done."""
        self.show(label, done / ticks)


def minutes(seconds: float) -> str:
    """Return a duration as m:ss."""
    whole = round(seconds)
    return f"{whole // 60}:{whole % 60:02d}"
