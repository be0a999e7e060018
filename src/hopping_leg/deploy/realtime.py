"""Time as the loop sees it, and what keeps it: priority, memory, no collection, no sleep."""

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


_SPIN_SECONDS = 2e-4


class RealClock:
    """The computer's clock: sleeps until shortly before a deadline and spins for the rest."""

    def now(self) -> float:
        """Return the time."""
        return time.monotonic()

    def wait_until(self, deadline: float) -> float:
        """Return at a deadline; returns the time."""
        pause = deadline - time.monotonic() - _SPIN_SECONDS
        if pause > 0:
            time.sleep(pause)
        while (now := time.monotonic()) < deadline:
            pass
        return now


_PRIORITY = 60
"""Priority in SCHED_FIFO, 1 to 99; above ordinary work, below the kernel's own threads."""

_NOTICE = (
    "No permission for real-time priority (SCHED_FIFO): ticks may be late under load; run as root"
    " or allow it with `ulimit -r` (rtprio in /etc/security/limits.conf)."
)
_MCL_CURRENT, _MCL_FUTURE = 1, 2
_SWITCH_SECONDS = 1e-4


def prefer_this_process() -> str | None:
    """Give all threads real-time priority; return a notice where that is not permitted.

    One thread is not enough: whichever holds the interpreter must not be preempted either. New
    threads inherit it.
    """
    return None if _schedule_all("SCHED_FIFO", _PRIORITY) else _NOTICE


def _schedule_all(policy: str, priority: int) -> bool:
    threads = [int(task.name) for task in Path("/proc/self/task").glob("*")] or [0]
    done = True
    for thread in threads:
        try:
            os.sched_setscheduler(thread, getattr(os, policy), os.sched_param(priority))
        except (OSError, AttributeError) as error:  # macOS has none of it
            done &= isinstance(error, ProcessLookupError)
    return done


def lock_memory() -> str | None:
    """Keep the process in memory; return a notice where that is not permitted."""
    with contextlib.suppress(OSError, AttributeError):
        if ctypes.CDLL(None).mlockall(_MCL_CURRENT | _MCL_FUTURE) == 0:
            return None
    return (
        "No permission to lock memory (mlockall): a tick may be late when memory is swapped;"
        " run as root or allow it with `ulimit -l unlimited`."
    )


_LATENCY = Path("/dev/cpu_dma_latency")
"""Takes the time, us, within which processors must wake, as long as it is open."""


@contextlib.contextmanager
def processors_awake() -> Iterator[str | None]:
    """Keep processors out of sleep, which costs time and caches; yield a notice where forbidden."""
    with contextlib.ExitStack() as stack:
        notice = None
        try:
            stack.enter_context(_LATENCY.open("wb", buffering=0)).write(bytes(4))
        except FileNotFoundError:
            pass  # a computer that has no such sleep
        except OSError:
            notice = (
                f"No permission to keep the processors awake ({_LATENCY}): ticks take longer; run"
                " as root or permit writing it."
            )
        yield notice


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
def keeping_time() -> Iterator[tuple[str, ...]]:
    """Let a loop run undisturbed; yield notices of what the computer does not permit."""
    notices = (lock_memory(), prefer_this_process())
    try:
        with processors_awake() as asleep, uninterrupted():
            yield tuple(notice for notice in (*notices, asleep) if notice)
    finally:
        _schedule_all("SCHED_OTHER", 0)
        with contextlib.suppress(OSError, AttributeError):
            ctypes.CDLL(None).munlockall()
