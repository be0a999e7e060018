"""The operator's keys: heights up and down, stop."""

import contextlib
import math
import os
import select
import sys
import termios
import threading
import tty
from collections.abc import Callable, Iterator

from hopping_leg.controllers.command_schedule import Range

_STEP = 0.01  # Change of the commanded height by one key, m
_UP = (b"+", b"k", b"\x1b[A")
_DOWN = (b"-", b"j", b"\x1b[B")
_STOP = (b" ", b"q", b"\x1b", b"\r", b"\n")
_PATIENCE = 0.1


class LiveHeight:
    """A height that the operator changes while the leg hops; ``valid`` is its range, m."""

    def __init__(self, height: float, valid: Range) -> None:
        self._height, self.valid = height, valid

    def at(self, elapsed: float) -> float:
        """Return the height commanded now, m."""
        return self._height

    def set(self, height: float) -> float:
        """Command a height, brought into its range; return it, m. What is no number is left."""
        low, high = self.valid
        if not math.isnan(height):
            self._height = round(min(max(height, low), high), 4)
        return self._height

    def change(self, by: float) -> float:
        """Raise or lower the height, within its range; return it, m."""
        return self.set(self._height + by)


def handle_key(key: bytes, height: LiveHeight | None, stop: Callable[[], None]) -> str:
    """Do what a key asks for; return what to show the operator.

    ``height`` is None where a schedule commands.
    """
    if key in _STOP:
        stop()
        return "stopping"
    if height is not None and key in _UP + _DOWN:
        return f"height {height.change(_STEP if key in _UP else -_STEP):.2f} m"
    return ""


@contextlib.contextmanager
def keys(
    height: LiveHeight | None, stop: Callable[[], None], show: Callable[[str], None]
) -> Iterator[None]:
    """Listen to the keyboard in a thread; do nothing where there is no terminal.

    ``height`` is None where a schedule commands; ``show`` shows the operator a line.
    """
    if not sys.stdin.isatty():
        yield
        return
    descriptor = sys.stdin.fileno()
    before = termios.tcgetattr(descriptor)
    over = threading.Event()

    def listen() -> None:
        while not over.is_set():
            ready, _, _ = select.select([descriptor], [], [], _PATIENCE)
            if ready and (words := handle_key(os.read(descriptor, 8), height, stop)):
                show(words)

    thread = threading.Thread(target=listen, name="keyboard", daemon=True)
    tty.setcbreak(descriptor)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()
        termios.tcsetattr(descriptor, termios.TCSADRAIN, before)
