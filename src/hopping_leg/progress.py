"""How long work goes: a live bar on a terminal, a line now and then elsewhere."""

import contextlib
import math
import threading
import time
from collections.abc import Callable, Iterator
from typing import Self

from rich import progress

from hopping_leg.terminal import plain_console

_SILENCE = 1.5
"""Time after which work that has said nothing says what it is, s."""
_LINE_SECONDS = 30.0
_PACE_SECONDS = 600.0
"""Latest time whose pace tells the time left, s."""


class LiveProgress(contextlib.ExitStack):
    """A bar per label with a note beside it, as a context manager; its heirs say what is noted.

    Args:
        title: What is done, as long as no label is shown.
        parts: How many labels there will be; 0 if that is unknown.
        quiet: Show nothing.
        lines: Write lines instead of bars; None does so where there is no terminal.
    """

    def __init__(
        self, title: str = "", *, parts: int = 0, quiet: bool = False, lines: bool | None = None
    ) -> None:
        super().__init__()
        self._console = plain_console(stderr=True, quiet=quiet)
        self._lines = not self._console.is_terminal if lines is None else lines
        self._bar = progress.Progress(
            progress.TextColumn("{task.description}", markup=False),
            progress.BarColumn(bar_width=20),
            progress.TextColumn("{task.percentage:>3.0f} %"),
            progress.TimeElapsedColumn(),
            progress.TextColumn("{task.fields[note]}", markup=False),
            console=self._console,
            disable=self._lines,
            speed_estimate_period=_PACE_SECONDS,
            get_time=lambda: time.monotonic(),
        )
        self._waiting = self._bar.add_task(title, total=None, note="") if title else None
        self._parts, self._tasks = parts, dict[str, progress.TaskID]()
        self._began = time.monotonic()
        self.text = title
        """What the next line says."""

    @property
    def passed(self) -> float:
        """Time since the work began, s."""
        return time.monotonic() - self._began

    def _show(
        self,
        key: str,
        label: str,
        share: float,
        note: str = "",
        left: float | None = None,
        *,
        at_once: bool = False,
    ) -> None:
        """Show a share done, 0 to 1, on the bar of a key, and in the next line.

        ``left`` is a reckoning of one's own, s; ``at_once`` writes a line now.
        """
        if self._waiting is not None:
            self._bar.remove_task(self._waiting)
            self._waiting = None
        if key not in self._tasks:
            self._tasks[key] = self._bar.add_task(label, total=1.0, note="")
        task = self._tasks[key]
        if self._parts > 1:
            label = f"{list(self._tasks).index(key) + 1} of {self._parts}: {label}"
        self._bar.update(task, description=label, completed=share)
        if left is None:
            left = self._left(task)
        known = share < 1 and math.isfinite(left)
        note = " · ".join(filter(None, (note, f"about {minutes(left)} left" if known else "")))
        self._bar.update(task, note=note)
        self.text = " · ".join(filter(None, (f"{label} {100 * share:.0f} %".strip(), note)))
        if at_once:
            self._line()

    def _left(self, task: progress.TaskID) -> float:
        """Return the time left, s, at the pace so far; NaN if that tells nothing."""
        with contextlib.suppress(OverflowError, ValueError):
            left = next(t.time_remaining for t in self._bar.tasks if t.id == task)
            return math.nan if left is None else left
        return math.nan

    def _line(self) -> None:
        if self._lines and self.text:
            self._console.print(self.text, soft_wrap=True)

    def __enter__(self) -> Self:
        """Start drawing."""
        self.enter_context(self._bar)
        self.enter_context(_repeated(self._line, _SILENCE))
        return self


class ShareProgress(LiveProgress):
    """A bar per label that shows the share done, elapsed time and time left."""

    def show(self, label: str, share: float, about: str = "") -> None:
        """Show the share done, 0 to 1, of what a label, and more about it, stands for."""
        self._show(label + about, label + about, share)

    def show_tick(self, label: str, ticks: int, done: int, _: object) -> None:
        """Show how many of so many ticks are done."""
        self.show(label, done / ticks)


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
