"""How the package compiles its inner loops with numba: once, kept between processes.

Numba notices that a function's own file changed, but not what it calls in other files; so the
compiled code lies in a folder that is named by a digest of the files that others call.
"""

import getpass
import hashlib
import multiprocessing
import os
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba.core import config

_SOURCES = ("compiled.py", "leg_physics.py", "stepper.py")
"""Files whose functions others call. Of what calls them, numba tracks the changes itself."""

_OPTIONS = {"nogil": True, "error_model": "numpy"}
"""Without ``fastmath``, so that no compiler reorders a sum."""


Function = TypeVar("Function", bound=Callable[..., Any])


def _cache_folder() -> str | None:
    """Return this user's folder for the sources as they are, None if none can be written."""
    digest = hashlib.sha256(f"{sys.version}{numba.__version__}".encode())
    for name in _SOURCES:
        digest.update((Path(__file__).parent / name).read_bytes())
    for find in (_in_home, _in_temporary):
        try:
            folder = find() / digest.hexdigest()[:16]
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            # What another user left there must not be run.
            own = not hasattr(os, "getuid") or folder.stat().st_uid == os.getuid()
        except (OSError, RuntimeError, KeyError):
            continue
        if own and os.access(folder, os.W_OK):
            return str(folder)
    return None


def _in_home() -> Path:
    home = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    return Path(home).expanduser() / "hopping-leg"


def _in_temporary() -> Path:
    return Path(tempfile.gettempdir()) / f"hopping-leg-{getpass.getuser()}"


FOLDER = _cache_folder()
"""Where the compiled code lies; None if it lives as long as the process."""


def compiled(function: Function) -> Function:
    """Compile a function at its first call or load it from the cache; it runs without the GIL."""
    before, config.CACHE_DIR = config.CACHE_DIR, FOLDER or ""
    try:
        result: Function = numba.njit(cache=FOLDER is not None, **_OPTIONS)(function)
        return result
    finally:
        config.CACHE_DIR = before


def inlined(function: Function) -> Function:
    """Compile a function into those that call it; LLVM does that in half of numba's time."""
    result: Function = numba.njit(forceinline=True, **_OPTIONS)(function)
    return result


@contextmanager
def compiling_notice(*functions: Callable[..., Any]) -> Iterator[None]:
    """Say on stderr, after a second, if one of the functions is being compiled rather than loaded.

    It is said once. Workers say nothing: each of them would.
    """
    done = threading.Event()

    def watch() -> None:
        while not done.wait(1.0):
            if any(one.stats.cache_misses for one in functions):  # type: ignore[attr-defined]
                say_compiling()
                return

    if multiprocessing.parent_process() is None:
        threading.Thread(target=watch, daemon=True).start()
    try:
        yield
    finally:
        done.set()


def was_compiled(function: Callable[..., Any]) -> bool:
    """Tell whether a process that ended has left the compiled function behind."""
    name = f"{function.__module__.rpartition('.')[2]}.{function.__name__}"
    return FOLDER is not None and any(Path(FOLDER).glob(f"*/{name}-*.nbc"))


@cache
def say_compiling() -> None:
    """Say on stderr, once, that the physics is being compiled."""
    text = "Compiling the leg's physics, once; some ten seconds."
    print(text, file=sys.stderr, flush=True)
