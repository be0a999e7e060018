"""What a terminal shows: texts as they are, tables with whole values, how long work goes."""

import contextlib
import time
from typing import Self

import rich.progress
from rich.console import Console
from rich.table import Table

_LINE_SECONDS = 30.0
_PACE_SECONDS = 600.0  # Latest time whose pace tells the time left, s


def plain_console(*, stderr: bool = False, quiet: bool = False) -> Console:
    """Return a console that takes no part of a text for markup or emoji."""
    return Console(stderr=stderr, quiet=quiet, markup=False, emoji=False, highlight=False)


def print_table(table: Table, console: Console | None = None) -> None:
    """Print a table; on a terminal as wide as that is, elsewhere with one line for each row."""
    console = console or plain_console()
    for column in table.columns:
        column.overflow = "fold"
    if not console.is_terminal:
        limit = console.options.update(max_width=10_000)
        table.width = console.measure(table, options=limit).maximum
    console.print(table, crop=False)


class Progress(contextlib.AbstractContextManager["Progress"]):
    """A bar of all work on a terminal, a line every half minute elsewhere, nothing if ``quiet``.

    The title is shown as long as no label is; ``parts`` is how many labels the work has, each from
    0 to 1, or 0 where shares are of all work.
    """

    def __init__(self, title: str = "", *, parts: int = 0, quiet: bool = False) -> None:
        self._console = plain_console(stderr=True, quiet=quiet)
        self._bar = rich.progress.Progress(
            rich.progress.TextColumn("{task.description}", markup=False),
            rich.progress.BarColumn(bar_width=20),
            rich.progress.TextColumn("{task.percentage:>3.0f} %"),
            rich.progress.TimeRemainingColumn(),
            rich.progress.TextColumn("{task.fields[note]}", markup=False),
            console=self._console,
            disable=not self._console.is_terminal,
            speed_estimate_period=_PACE_SECONDS,
        )
        self._task = self._bar.add_task(title, total=None, note="")
        self._parts, self._labels, self._said = parts, list[str](), time.monotonic()

    def show(self, label: str, share: float, note: str = "", *, about: str = "") -> None:
        """Show what is done, more of that label, the share done, 0 to 1, and what stands behind."""
        label += about
        if label not in self._labels:
            self._labels.append(label)
        if self._parts > 1:
            number = self._labels.index(label)
            share = (number + share) / self._parts
            label = f"{number + 1} of {self._parts}: {label}"
        if share < self._bar.tasks[0].completed:
            self._bar.reset(self._task)
        self._bar.update(self._task, description=label, completed=share, total=1.0, note=note)
        if self._bar.disable and time.monotonic() - self._said >= _LINE_SECONDS:
            self._said = time.monotonic()
            left = self._bar.tasks[0].time_remaining
            rest = f", {left:.0f} s left" if left else ""
            self._console.print(f"{label} {100 * share:.0f} %{rest} {note}".strip(), soft_wrap=True)

    def __enter__(self) -> Self:
        """Start drawing."""
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Leave the bar as it is."""
        self._bar.stop()
