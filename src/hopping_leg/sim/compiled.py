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
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba.core import config

_SOURCES = ("compiled.py", "lanes.py", "leg_physics.py", "stepper.py")
"""Files whose functions others call. Of what calls them, numba tracks the changes itself."""

_OPTIONS = {"nogil": True, "error_model": "numpy"}
"""Without ``fastmath``, so that no compiler reorders a sum."""


Function = TypeVar("Function", bound=Callable[..., Any])


def _cache_folder() -> str | None:
    """Return this user's folder for the sources as they are, None if none can be written."""
    digest = hashlib.sha256(f"{sys.version}{numba.__version__}".encode())
    for name in _SOURCES:
        digest.update((Path(__file__).parent / name).read_bytes())
    home = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    user = os.getuid() if hasattr(os, "getuid") else getpass.getuser()
    for parent in (f"{home}/hopping-leg", f"{tempfile.gettempdir()}/hopping-leg-{user}"):
        try:
            folder = Path(parent).expanduser() / digest.hexdigest()[:16]
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            # What another user left there must not be run.
            own = not hasattr(os, "getuid") or folder.stat().st_uid == user
        except (OSError, RuntimeError):
            continue
        if own and os.access(folder, os.W_OK):
            return str(folder)
    return None


FOLDER = _cache_folder()  # Where the compiled code lies; None if it lives as long as the process


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
    alone = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}  # nothing else calls it
    result: Function = numba.njit(forceinline=True, **alone, **_OPTIONS)(function)
    return result


def announce(*functions: Callable[..., Any]) -> None:
    """Say on stderr, once, if a function has yet to be compiled. Workers say nothing."""
    names = [f"{f.__module__.rpartition('.')[2]}.{f.__name__}" for f in functions]
    known = FOLDER is not None and all(any(Path(FOLDER).glob(f"*/{n}-*.nbc")) for n in names)
    if multiprocessing.parent_process() is None and not known:
        say_compiling()


@cache
def say_compiling() -> None:
    """Say on stderr, once, that the physics is being compiled."""
    text = "Compiling the leg's physics, once; some ten seconds."
    print(text, file=sys.stderr, flush=True)
