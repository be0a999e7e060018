"""The operator's keys: heights up and down; any other key, or the end of all input, stops."""

import contextlib
import os
import re
import select
import stat
import sys
import threading
from collections.abc import Callable, Iterator

from hopping_leg.controllers.command_schedule import Range

_STEP = 0.01  # Change of the commanded height by one key, m
_UP = (b"+", b"k", b"\x1b[A", b"\x1bOA")
_DOWN = (b"-", b"j", b"\x1b[B", b"\x1bOB")
_KEY = re.compile(rb"\x1b[\[O][AB]|.", re.DOTALL)
_PATIENCE = 0.1


class LiveHeight:
    """A height that the operator changes while the leg hops; ``valid`` is its range, m."""

    def __init__(self, height: float, valid: Range) -> None:
        self._height, self._valid = height, valid

    def at(self, elapsed: float) -> float:
        """Return the height commanded now, m."""
        return self._height

    def change(self, by: float) -> float:
        """Raise or lower the height, within its range; return it, m."""
        low, high = self._valid
        self._height = round(min(max(self._height + by, low), high), 4)
        return self._height


def handle_keys(data: bytes, height: LiveHeight | None, stop: Callable[[], None]) -> str:
    """Do what keys ask for that arrived together; return what to show the operator.

    Whatever is no key for the height stops the leg, and so does no data: the end of input.
    ``height`` is None where a schedule commands.
    """
    pressed = _KEY.findall(data)
    if not pressed or not {*pressed} <= {*_UP, *_DOWN}:
        stop()
        return "stopping"
    if height is None:
        return ""
    return f"height {height.change(sum(_STEP if k in _UP else -_STEP for k in pressed)):.2f} m"


@contextlib.contextmanager
def keys(
    height: LiveHeight | None, stop: Callable[[], None], show: Callable[[str], None]
) -> Iterator[None]:
    """Listen to a terminal or pipe in a thread; do nothing where standard input is neither.

    ``height`` is None where a schedule commands; ``show`` shows the operator a line.
    """
    try:
        descriptor = sys.stdin.fileno()
        kind = os.fstat(descriptor).st_mode
    except (AttributeError, ValueError, OSError):  # closed from the start, or replaced
        yield
        return
    terminal = os.isatty(descriptor)
    if not (terminal or stat.S_ISFIFO(kind) or stat.S_ISSOCK(kind)):
        yield
        return
    import termios  # POSIX alone has both
    import tty

    over = threading.Event()

    def listen() -> None:
        data = b"begun"
        while data and not over.is_set():
            try:
                if not select.select([descriptor], [], [], _PATIENCE)[0]:
                    continue
                data = os.read(descriptor, 1024)
            except (OSError, ValueError):
                data = b""  # the terminal is gone, or the input was closed
            words = handle_keys(data, height, stop)
            with contextlib.suppress(OSError, ValueError):
                show(words)

    thread = threading.Thread(target=listen, name="keyboard", daemon=True)
    before = termios.tcgetattr(descriptor) if terminal else None
    if terminal:
        tty.setcbreak(descriptor)
        attributes = termios.tcgetattr(descriptor)
        attributes[0] &= ~termios.IXON  # else Ctrl-S would hold up what is shown, and the keys
        termios.tcsetattr(descriptor, termios.TCSANOW, attributes)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join(10 * _PATIENCE)
        if before is not None:
            with contextlib.suppress(termios.error):
                termios.tcsetattr(descriptor, termios.TCSADRAIN, before)
