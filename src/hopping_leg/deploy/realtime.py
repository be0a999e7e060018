"""What makes a thread keep its time: priority, locked memory, no garbage collection in between."""

import contextlib
import ctypes
import gc
import os
import sys
from collections.abc import Iterator

PRIORITY = 60
"""Of SCHED_FIFO, 1 to 99; above ordinary work, below the kernel's own threads."""

_MCL_CURRENT, _MCL_FUTURE = 1, 2
_SWITCH_SECONDS = 1e-4


def prefer_this_thread() -> str | None:
    """Give the calling thread real-time priority; return a notice where that is not permitted."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    except (OSError, AttributeError):
        return (
            "No permission for real-time priority (SCHED_FIFO): ticks may be late under load;"
            " run as root or allow it with `ulimit -r` (rtprio in /etc/security/limits.conf)."
        )
    return None


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
