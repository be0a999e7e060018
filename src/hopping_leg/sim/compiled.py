"""How the package compiles its inner loops with numba: once, kept between processes.

Numba notices that a function's own file changed, but not what it calls in other files; so the
compiled code lies in a folder that is named by a digest of the files that others call.
"""

import hashlib
import os
import sys
import tempfile
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba.core import config

_SOURCES = ("compiled.py", "leg_physics.py", "stepper.py")
"""Files whose functions others call. Of what calls them, numba tracks the changes itself."""

_OPTIONS = {"nogil": True, "error_model": "numpy"}
"""Without ``fastmath``, so that no compiler reorders a sum."""


Function = TypeVar("Function", bound=Callable[..., Any])


def _cache_folder() -> Path:
    """Return the folder for the sources as they are, in the user's cache if that can be written."""
    digest = hashlib.sha256(f"{sys.version}{numba.__version__}".encode())
    for name in _SOURCES:
        digest.update((Path(__file__).parent / name).read_bytes())
    home = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    folder = Path(home).expanduser() / "hopping-leg" / digest.hexdigest()[:16]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if os.access(folder, os.W_OK):
            return folder
    except OSError:
        pass
    return Path(tempfile.gettempdir()) / f"hopping-leg-{digest.hexdigest()[:16]}"


_FOLDER = _cache_folder()


def compiled(function: Function) -> Function:
    """Compile a function at its first call or load it from the cache; it runs without the GIL."""
    before, config.CACHE_DIR = config.CACHE_DIR, str(_FOLDER)
    try:
        result: Function = numba.njit(cache=True, **_OPTIONS)(function)
        return result
    finally:
        config.CACHE_DIR = before


def inlined(function: Function) -> Function:
    """Compile a function into those that call it."""
    result: Function = numba.njit(inline="always", **_OPTIONS)(function)
    return result


class CompilingNotice:
    """Says on stderr that the physics is being compiled if its block takes over a second.

    Loading what is compiled already takes less, or is not to be told.
    """

    def __enter__(self) -> None:
        self._timer = threading.Timer(1.0, self._say)
        self._timer.daemon = True
        if not any(_FOLDER.rglob("*.nbc")):
            self._timer.start()

    def __exit__(self, *_: object) -> None:
        self._timer.cancel()

    @staticmethod
    def _say() -> None:
        print("Compiling the leg's physics, once; some ten seconds.", file=sys.stderr, flush=True)
