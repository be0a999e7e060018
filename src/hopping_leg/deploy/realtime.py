"""Time as the loop sees it, and what keeps it: priority, locked memory, no garbage collection."""

import contextlib
import ctypes
import gc
import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Protocol


class Clock(Protocol):
    """A monotonic clock, s."""

    def now(self) -> float:
        """Return the time."""

    def wait_until(self, deadline: float) -> float:
        """Return at a deadline, or at once if it is over; returns the time."""

    def patience(self, until: float) -> float:
        """Return how many of the computer's seconds something due at a time is worth waiting."""


class RealClock:
    """The computer's clock: sleeps until shortly before a deadline and spins for the rest.

    Args:
        spin: Time to spin, s.
    """

    def __init__(self, spin: float = 2e-4) -> None:
        self._spin = spin

    def now(self) -> float:
        """Return the time."""
        return time.monotonic()

    def wait_until(self, deadline: float) -> float:
        """Return at a deadline; returns the time."""
        pause = deadline - time.monotonic() - self._spin
        if pause > 0:
            time.sleep(pause)
        while (now := time.monotonic()) < deadline:
            pass
        return now

    def patience(self, until: float) -> float:
        """Return the time that is left."""
        return max(until - time.monotonic(), 0.0)


PRIORITY = 60
"""Priority in SCHED_FIFO, 1 to 99; above ordinary work, below the kernel's own threads."""

_NOTICE = (
    "No permission for real-time priority (SCHED_FIFO): ticks may be late under load; run as root"
    " or allow it with `ulimit -r` (rtprio in /etc/security/limits.conf)."
)
_MCL_CURRENT, _MCL_FUTURE = 1, 2
_SWITCH_SECONDS = 1e-4


def prefer_this_thread() -> str | None:
    """Give the calling thread real-time priority; return a notice where that is not permitted."""
    return None if _schedule(0, os.SCHED_FIFO, PRIORITY) else _NOTICE


def prefer_this_process() -> str | None:
    """Give all threads real-time priority; return a notice where that is not permitted.

    One thread is not enough: whichever holds the interpreter must not be preempted either. New
    threads inherit it.
    """
    threads = [int(entry.name) for entry in Path("/proc/self/task").iterdir()]
    done = [_schedule(thread, os.SCHED_FIFO, PRIORITY) for thread in threads]
    return None if all(done) else _NOTICE


def prefer_nothing() -> None:
    """Give all threads ordinary priority again."""
    for entry in Path("/proc/self/task").iterdir():
        _schedule(int(entry.name), os.SCHED_OTHER, 0)


def _schedule(thread: int, policy: int, priority: int) -> bool:
    try:
        os.sched_setscheduler(thread, policy, os.sched_param(priority))
    except ProcessLookupError:
        return True
    except OSError:
        return False
    return True


def lock_memory() -> str | None:
    """Keep the process in memory; return a notice where that is not permitted."""
    try:
        libc = ctypes.CDLL(None, use_errno=True)
        locked = libc.mlockall(_MCL_CURRENT | _MCL_FUTURE) == 0
    except (OSError, AttributeError):
        locked = False
    if locked:
        return None
    return (
        "No permission to lock memory (mlockall): a tick may be late when memory is swapped;"
        " run as root or allow it with `ulimit -l unlimited`."
    )


def release_memory() -> None:
    """Let the process be swapped again; nothing happens where memory was not locked."""
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).munlockall()


@contextlib.contextmanager
def uninterrupted() -> Iterator[None]:
    """Hold off garbage collection and hand the interpreter over to waiting threads quickly."""
    enabled, interval = gc.isenabled(), sys.getswitchinterval()
    gc.collect()
    gc.freeze()
    gc.disable()
    sys.setswitchinterval(_SWITCH_SECONDS)
    try:
        yield
    finally:
        sys.setswitchinterval(interval)
        gc.unfreeze()
        if enabled:
            gc.enable()


@contextlib.contextmanager
def keeping_time(*, realtime: bool) -> Iterator[tuple[str, ...]]:
    """Let a loop run undisturbed; yields notices of what the computer does not permit.

    Args:
        realtime: Ask for priority and locked memory, too.
    """
    notices = (lock_memory(), prefer_this_process()) if realtime else ()
    try:
        with uninterrupted():
            yield tuple(notice for notice in notices if notice)
    finally:
        if realtime:
            prefer_nothing()
            release_memory()
