"""What one process holds at a time, and gives back when it ends, however that is."""

import contextlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

from filelock import BaseFileLock, FileLock, Timeout

from hopping_leg.errors import Error
from hopping_leg.io import safe_file_name

FOLDER_LOCK = ".lock"  # Name of the file that says who works in a folder


def named_lock(name: str, what: str, error: Error) -> BaseFileLock:
    """Hold a name on this computer until ``release``; ``what`` is its name in messages."""
    file = f"hopping-leg-{safe_file_name(name)}.lock"
    return _held(Path(tempfile.gettempdir()) / file, what, error)


@contextlib.contextmanager
def hold_folder(folder: Path, error: Error) -> Iterator[None]:
    """Let no other process work in a folder meanwhile; where one does raise ``error``."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise error(f"{folder} cannot be made a folder: {problem.strerror}.") from problem
    with _held(folder / FOLDER_LOCK, str(folder), error):
        yield


def _held(file: Path, what: str, error: Error) -> BaseFileLock:
    lock = FileLock(file, blocking=False, thread_local=False)
    try:
        lock.acquire()
    except Timeout:
        raise error(f"{what} is in use by another process; end that first.") from None
    except OSError as problem:
        raise error(f"Cannot open {file}: {problem.strerror}.") from problem
    return lock


class DeviceLock:
    """Holds a device, which no other process may have open, until ``close``."""

    def __init__(self, path: Path, error: Error) -> None:
        import fcntl  # POSIX alone has it

        try:
            self._descriptor = os.open(path, os.O_RDONLY | os.O_NOCTTY | os.O_NONBLOCK)
        except OSError as problem:
            raise error(f"Cannot open {path}: {problem.strerror}.") from problem
        others = [*_holders(self._descriptor)] if os.isatty(self._descriptor) else []
        try:
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            others = others or ["another process, or this one"]
        if others:
            self.close()
            raise error(f"{path} is in use by {' and '.join(others)}; end that first.")

    def close(self) -> None:
        """Give it back; again does nothing."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1


def _holders(terminal: int) -> Iterator[str]:
    """Yield the other processes that have a terminal open, but for the one that serves it."""
    sought = os.ttyname(terminal)
    for process in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):  # it ended, or is another user's
            opened = {str(entry.readlink()) for entry in (process / "fd").iterdir()}
            own = process.name == str(os.getpid())
            if sought in opened and not own and not opened & {"/dev/ptmx", "/dev/pts/ptmx"}:
                words = (process / "cmdline").read_bytes() or (process / "comm").read_bytes()
                name = words.decode(errors="replace").replace("\0", " ").strip()
                yield f"process {process.name} ({name[:80]})"
