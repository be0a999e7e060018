"""What one process holds at a time, and gives back when it ends, however that is."""

import contextlib
import fcntl
import os
import socket
import tempfile
from collections.abc import Iterator
from pathlib import Path

from hopping_leg.errors import HoppingLegError
from hopping_leg.io import safe_file_name

FOLDER_LOCK = ".lock"
"""Name of the file that says who works in a folder."""

_MASTERS = ("/dev/ptmx", "/dev/pts/ptmx")


class Lock:
    """Holds a device or file until ``close``.

    Args:
        path: Device or file.
        what: Its name in messages.
        error: Raised where somebody else holds it; says who.
        make: Whether the file is made if there is none; a device that is gone must not become one.
    """

    def __init__(
        self, path: Path, what: str, error: type[HoppingLegError], *, make: bool = True
    ) -> None:
        flags = os.O_RDONLY | os.O_NOCTTY | os.O_NONBLOCK
        try:
            made = os.O_CREAT if make and not path.exists() else 0
            self._descriptor = os.open(path, flags | made, 0o644)
        except OSError as problem:
            raise error(f"Cannot open {path}: {problem.strerror}.") from problem
        busy, terminal = False, os.isatty(self._descriptor)
        try:
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            busy = True
        others = list(_holders(path, served=terminal)) if busy or terminal else []
        if busy and not others:
            others = ["another process, or this one"]
        if others:
            self.close()
            raise error(f"{what} is in use by {' and '.join(others)}; end that first.")

    def close(self) -> None:
        """Give it back; again does nothing."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1


def named_lock(name: str, what: str, error: type[HoppingLegError]) -> Lock:
    """Hold a name on this computer."""
    file = f"hopping-leg-{safe_file_name(name)}.lock"
    return Lock(Path(tempfile.gettempdir()) / file, what, error)


@contextlib.contextmanager
def hold_folder(folder: Path, error: type[HoppingLegError]) -> Iterator[None]:
    """Let no other process work in a folder meanwhile; what one of this host left is taken over.

    Raises:
        HoppingLegError: ``error``, which names the process and host that hold it.
    """
    file, here = folder / FOLDER_LOCK, socket.gethostname()
    made = not folder.exists()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise error(f"{folder} cannot be made a folder: {problem.strerror}.") from problem
    left = file.read_text(encoding="utf-8", errors="replace").strip() if file.exists() else ""
    lock = Lock(file, str(folder), error)
    try:
        if left and not left.endswith(f" on {here}"):
            raise error(f"{folder} is in use by {left}; if that has ended, delete {file}.")
        file.write_text(f"process {os.getpid()} on {here}\n", encoding="utf-8")
        try:
            yield
        finally:
            file.unlink(missing_ok=True)
    finally:
        lock.close()
        if made:
            with contextlib.suppress(OSError):  # it holds something by now
                folder.rmdir()


def _holders(path: Path, *, served: bool) -> Iterator[str]:
    """Yield the other processes that have a file open, but for whoever serves it if it is."""
    sought = path.stat()
    for process in Path("/proc").glob("[0-9]*"):
        if process.name == str(os.getpid()):
            continue
        with contextlib.suppress(OSError):  # it ended, or is another user's
            opened = list((process / "fd").iterdir())
            serves = served and any(_target(entry) in _MASTERS for entry in opened)
            if not serves and any(_same(entry, sought) for entry in opened):
                words = (
                    (process / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
                )
                yield f"process {process.name} ({words.strip()[:80]})"


def _target(entry: Path) -> str:
    with contextlib.suppress(OSError):
        return str(entry.readlink())
    return ""


def _same(entry: Path, sought: os.stat_result) -> bool:
    with contextlib.suppress(OSError):
        return os.path.samestat(entry.stat(), sought)
    return False
