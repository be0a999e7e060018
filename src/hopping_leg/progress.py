"""How long work goes: a live bar on a terminal, a line now and then elsewhere."""

import contextlib
import threading
import time
from collections.abc import Callable, Iterator
from typing import Self

import rich.progress

from hopping_leg.terminal import plain_console

_SILENCE = 1.5
"""Time after which work that has said nothing says what it is, s."""
_LINE_SECONDS = 30.0
_PACE_SECONDS = 600.0
"""Latest time whose pace tells the time left, s."""


class Progress(contextlib.ExitStack):
    """A bar per key with label, share done, time left and a note, as a context manager.

    Args:
        title: What is done, as long as no label is shown.
        parts: How many keys there will be; 0 if that is unknown.
        quiet: Show nothing.
    """

    def __init__(self, title: str = "", *, parts: int = 0, quiet: bool = False) -> None:
        super().__init__()
        self._console = plain_console(stderr=True, quiet=quiet)
        self._bar = rich.progress.Progress(
            rich.progress.TextColumn("{task.description}", markup=False),
            rich.progress.BarColumn(bar_width=20),
            rich.progress.TextColumn("{task.percentage:>3.0f} %"),
            rich.progress.TimeElapsedColumn(),
            rich.progress.TextColumn("{task.fields[note]}", markup=False),
            console=self._console,
            disable=not self._console.is_terminal,
            speed_estimate_period=_PACE_SECONDS,
            get_time=lambda: time.monotonic(),
        )
        self._waiting = self._bar.add_task(title, total=None, note="") if title else None
        self._parts, self._tasks = parts, dict[str, rich.progress.TaskID]()
        self._began = time.monotonic()
        self.text = title
        """What the next line says."""

    @property
    def passed(self) -> float:
        """Time since the work began, s."""
        return time.monotonic() - self._began

    def show(
        self, label: str, share: float, note: str = "", *, about: str = "", key: str = ""
    ) -> None:
        """Show a share done, 0 to 1, on a bar and in the next line.

        Args:
            label: What is done.
            share: How much of it.
            note: Stands behind.
            about: More of the label.
            key: Of the bar; default: the label.
        """
        label += about
        key = key or label
        if self._waiting is not None:
            self._bar.remove_task(self._waiting)
            self._waiting = None
        if key not in self._tasks:
            self._tasks[key] = self._bar.add_task(label, total=1.0, note="")
        number = self._tasks[key]
        if self._parts > 1:
            label = f"{list(self._tasks).index(key) + 1} of {self._parts}: {label}"
        self._bar.update(number, description=label, completed=share)
        task = next(task for task in self._bar.tasks if task.id == number)
        left = None
        with contextlib.suppress(OverflowError, ValueError):  # no pace is known yet
            left = task.time_remaining
        coming = f"about {minutes(left)} left" if share < 1 and left is not None else ""
        note = " · ".join(filter(None, (note, coming)))
        self._bar.update(number, note=note)
        self.text = " · ".join(filter(None, (f"{label} {100 * share:.0f} %".strip(), note)))

    def show_tick(self, label: str, ticks: int, done: int, _: object) -> None:
        """Show how many of so many ticks are done."""
        self.show(label, done / ticks)

    def _line(self) -> None:
        if self._bar.disable and self.text:
            self._console.print(self.text, soft_wrap=True)

    def __enter__(self) -> Self:
        """Start drawing."""
        self.enter_context(self._bar)
        self.enter_context(_repeated(self._line, _SILENCE))
        return self


@contextlib.contextmanager
def _repeated(say: Callable[[], None], first: float) -> Iterator[None]:
    """Call something after a time, s, and then every 30 s."""
    over = threading.Event()

    def watch() -> None:
        wait = first
        while not over.wait(wait):
            say()
            wait = _LINE_SECONDS

    threading.Thread(target=watch, daemon=True).start()
    try:
        yield
    finally:
        over.set()


@contextlib.contextmanager
def said_if_slow(text: str) -> Iterator[None]:
    """Say on stderr what is going on: on a terminal soon, elsewhere now and then."""
    console = plain_console(stderr=True)
    first = _SILENCE if console.is_terminal else _LINE_SECONDS
    with _repeated(lambda: console.print(text, soft_wrap=True), first):
        yield


def minutes(seconds: float) -> str:
    """Return a duration as m:ss."""
    whole = round(seconds)
    return f"{whole // 60}:{whole % 60:02d}"
