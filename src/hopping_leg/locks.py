"""What one process holds at a time, and gives back when it ends, however that is."""

import contextlib
import fcntl
import os
import socket
import tempfile
from collections.abc import Iterator
from pathlib import Path

from filelock import BaseFileLock, FileLock, Timeout

from hopping_leg.errors import HoppingLegError
from hopping_leg.io import safe_file_name

FOLDER_LOCK = ".lock"
"""Name of the file that says who works in a folder."""

_MASTERS = ("/dev/ptmx", "/dev/pts/ptmx")


def named_lock(name: str, what: str, error: type[HoppingLegError]) -> BaseFileLock:
    """Hold a name on this computer until ``release``; ``what`` is its name in messages."""
    file = f"hopping-leg-{safe_file_name(name)}.lock"
    return _held(Path(tempfile.gettempdir()) / file, what, error)


@contextlib.contextmanager
def hold_folder(folder: Path, error: type[HoppingLegError]) -> Iterator[None]:
    """Let no other process work in a folder meanwhile.

    Raises:
        HoppingLegError: ``error``, which names the process and host that hold it.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise error(f"{folder} cannot be made a folder: {problem.strerror}.") from problem
    file = folder / FOLDER_LOCK
    with _held(file, str(folder), error):
        file.write_text(f"process {os.getpid()} on {socket.gethostname()}\n", encoding="utf-8")
        yield


def _held(file: Path, what: str, error: type[HoppingLegError]) -> BaseFileLock:
    lock = FileLock(file, blocking=False, thread_local=False)
    try:
        lock.acquire()
    except Timeout:
        holder = file.read_text(encoding="utf-8", errors="replace").strip() or "another process"
        raise error(f"{what} is in use by {holder}; end that first.") from None
    except OSError as problem:
        raise error(f"Cannot open {file}: {problem.strerror}.") from problem
    return lock


class DeviceLock:
    """Holds a device, which no other process may have open, until ``close``."""

    def __init__(self, path: Path, error: type[HoppingLegError]) -> None:
        try:
            self._descriptor = os.open(path, os.O_RDONLY | os.O_NOCTTY | os.O_NONBLOCK)
        except OSError as problem:
            raise error(f"Cannot open {path}: {problem.strerror}.") from problem
        others = []
        try:
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            others = ["another process, or this one"]
        terminal = os.isatty(self._descriptor)
        if others or terminal:
            known = list(_holders(os.fstat(self._descriptor), served=terminal))
            others = known or others
        if others:
            self.close()
            raise error(f"{path} is in use by {' and '.join(others)}; end that first.")

    def close(self) -> None:
        """Give it back; again does nothing."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1


def _holders(sought: os.stat_result, *, served: bool) -> Iterator[str]:
    """Yield the other processes that have a file open, but for whoever serves it if it is."""
    for process in Path("/proc").glob("[0-9]*"):
        if process.name == str(os.getpid()):
            continue
        with contextlib.suppress(OSError):  # it ended, or is another user's
            opened = list((process / "fd").iterdir())
            serves = served and any(_target(entry) in _MASTERS for entry in opened)
            if not serves and any(_same(entry, sought) for entry in opened):
                words = (process / "cmdline").read_bytes().replace(b"\0", b" ")
                text = words.decode(errors="replace").strip()
                yield f"process {process.name} ({text[:80]})"


def _target(entry: Path) -> str:
    with contextlib.suppress(OSError):
        return str(entry.readlink())
    return ""


def _same(entry: Path, sought: os.stat_result) -> bool:
    with contextlib.suppress(OSError):
        return os.path.samestat(entry.stat(), sought)
    return False
