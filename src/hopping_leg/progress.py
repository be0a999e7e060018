"""How long work goes: a live bar on a terminal, a line now and then elsewhere."""

import contextlib
import itertools
import math
import threading
import time
from bisect import bisect_right
from collections.abc import Iterator
from types import TracebackType
from typing import Self

from rich import progress

from hopping_leg.terminal import plain_console

_SILENCE = 1.5
"""Time after which work that has said nothing says what it is, s."""
_LINE_SECONDS = 30.0
_LEAST_SHARE, _LEAST_SECONDS = 0.02, 3.0
"""What has to be done before the time left is told."""
_LATER = 1.2
"""Ratio of a new reckoning to the time told beyond which that is said to be too short."""
_MOST_KEPT = 200


class TimeLeft:
    """Reckons the time left from the pace of the later half of the time passed.

    What was told once never rises.
    """

    def __init__(self) -> None:
        self._times: list[float] = []
        self._shares: list[float] = []
        self.told = math.inf
        """What was told last, s."""

    def reckon(self, passed: float, share: float) -> float:
        """Return the time left, s, when a share, 0 to 1, is done at a time, s; NaN if unknown."""
        self._times.append(passed)
        self._shares.append(share)
        if len(self._times) > _MOST_KEPT:
            del self._times[1:-1:2], self._shares[1:-1:2]
        if share >= 1:
            return 0.0
        begun, first = self._times[0], self._shares[0]
        if share - first < _LEAST_SHARE or passed - begun < _LEAST_SECONDS:
            return math.nan
        middle = bisect_right(self._times, (begun + passed) / 2) - 1
        done = share - self._shares[middle]
        return (1 - share) * (passed - self._times[middle]) / done if done > 0 else math.inf

    def text(self, left: float) -> str:
        """Return what to say of a new reckoning, s: nothing if it is unknown."""
        if math.isnan(left):
            return ""
        late = left > _LATER * self.told
        self.told = min(self.told, left)
        return f"{'more than' if late else 'about'} {minutes(self.told)} left"


class LiveProgress:
    """A bar per label with a note beside it, as a context manager; its heirs say what is noted.

    Args:
        title: What is done, as long as no label is shown.
        parts: How many labels there will be; 0 if that is unknown.
        quiet: Show nothing.
        lines: Write lines instead of bars; None does so where there is no terminal.
        first_line: Time until the first line, s.
    """

    def __init__(
        self,
        title: str = "",
        *,
        parts: int = 0,
        quiet: bool = False,
        lines: bool | None = None,
        first_line: float = _SILENCE,
    ) -> None:
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
        )
        self._waiting = self._bar.add_task(title, total=None, note="") if title else None
        self._parts = parts
        self._tasks: dict[str, tuple[progress.TaskID, float, TimeLeft]] = {}
        self._began = time.monotonic()
        self._next_line, self._text = first_line, title
        self._writing, self._over = threading.Lock(), threading.Event()

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
        """Show a share done, 0 to 1, on the bar of a key, or in a line when one is due.

        ``left`` is a reckoning of one's own, s; ``at_once`` writes a line in any case.
        """
        if self._waiting is not None:
            self._bar.remove_task(self._waiting)
            self._waiting = None
        if key not in self._tasks:
            task = self._bar.add_task(label, total=1.0, note="")
            self._tasks[key] = task, self.passed, TimeLeft()
        task, begun, time_left = self._tasks[key]
        if self._parts > 1:
            label = f"{list(self._tasks).index(key) + 1} of {self._parts}: {label}"
        if left is None:
            left = time_left.reckon(self.passed - begun, share)
        said = " · ".join(filter(None, (note, time_left.text(left) if share < 1 else "")))
        self._bar.update(task, description=label, completed=share, note=said)
        self._text = " · ".join(filter(None, (f"{label} {100 * share:.0f} %".strip(), said)))
        if at_once:
            self._next_line = 0.0
        self._line_if_due()

    def _line(self, text: str) -> None:
        """Write a line now, where lines are written."""
        if self._lines:
            self._console.print(text, soft_wrap=True)

    def _line_if_due(self) -> None:
        """Write how far it is, where lines are written and the last one was long ago."""
        with self._writing:
            if self._lines and self._text and self.passed >= self._next_line:
                self._next_line = self.passed + _LINE_SECONDS
                self._line(self._text)

    def _keep_writing(self) -> None:
        while not self._over.wait(_SILENCE):
            self._line_if_due()

    def __enter__(self) -> Self:
        """Start drawing."""
        self._bar.start()
        if self._lines:
            threading.Thread(target=self._keep_writing, daemon=True).start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Stop drawing."""
        self._over.set()
        self._bar.stop()


class ShareProgress(LiveProgress):
    """A bar per label that shows the share done, elapsed time and time left."""

    def show(self, label: str, share: float, about: str = "") -> None:
        """Show the share done, 0 to 1, of what a label, and more about it, stands for."""
        self._show(label + about, label + about, share)

    def show_tick(self, label: str, ticks: int, done: int, _: object) -> None:
        """Show how many of so many ticks are done."""
        self.show(label, done / ticks)


@contextlib.contextmanager
def said_if_slow(text: str) -> Iterator[None]:
    """Say on stderr what is going on: on a terminal soon, elsewhere now and then."""
    over, began, console = threading.Event(), time.monotonic(), plain_console(stderr=True)
    first = _SILENCE if console.is_terminal else _LINE_SECONDS

    def watch() -> None:
        for wait in itertools.chain([first], itertools.repeat(_LINE_SECONDS)):
            if over.wait(wait):
                return
            passed = time.monotonic() - began
            since = f" {minutes(passed)} so far." if wait == _LINE_SECONDS else ""
            console.print(f"{text}{since}", soft_wrap=True)

    threading.Thread(target=watch, daemon=True).start()
    try:
        yield
    finally:
        over.set()


def minutes(seconds: float) -> str:
    """Return a duration as m:ss."""
    whole = round(seconds)
    return f"{whole // 60}:{whole % 60:02d}"
