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
        make: Whether it is a file that is made for this, and goes with ``close``.
    """

    def __init__(
        self, path: Path, what: str, error: type[HoppingLegError], *, make: bool = False
    ) -> None:
        self._file: Path | None = None  # That goes with it
        try:
            self._descriptor, busy = _opened(path, make)
        except OSError as problem:
            raise error(f"Cannot open {path}: {problem.strerror}.") from problem
        terminal = os.isatty(self._descriptor)
        others = (
            list(_holders(os.fstat(self._descriptor), served=terminal)) if busy or terminal else []
        )
        if busy and not others:
            others = ["another process, or this one"]
        if others:
            self.close()
            raise error(f"{what} is in use by {' and '.join(others)}; end that first.")
        self._file = path if make else None

    def close(self) -> None:
        """Give it back; again does nothing."""
        if self._descriptor >= 0:
            if self._file is not None:
                with contextlib.suppress(OSError):
                    self._file.unlink()
            os.close(self._descriptor)
            self._descriptor = -1


def _opened(path: Path, make: bool) -> tuple[int, bool]:
    """Return a locked descriptor of a file, or another's and that it is busy."""
    flags = os.O_RDONLY | os.O_NOCTTY | os.O_NONBLOCK
    while True:
        made = os.O_CREAT if make and not path.exists() else 0
        descriptor = os.open(path, flags | made, 0o644)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return descriptor, True
        if not make or _same(path, os.fstat(descriptor)):
            return descriptor, False
        os.close(descriptor)  # who held it took the file away meanwhile


def named_lock(name: str, what: str, error: type[HoppingLegError]) -> Lock:
    """Hold a name on this computer."""
    file = f"hopping-leg-{safe_file_name(name)}.lock"
    return Lock(Path(tempfile.gettempdir()) / file, what, error, make=True)


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
    if left and not left.endswith(f" on {here}"):
        raise error(f"{folder} is in use by {left}; if that has ended, delete {file}.")
    lock = Lock(file, str(folder), error, make=True)
    try:
        file.write_text(f"process {os.getpid()} on {here}\n", encoding="utf-8")
        yield
    finally:
        lock.close()
        if made:
            with contextlib.suppress(OSError):  # it holds something by now
                folder.rmdir()


def _holders(sought: os.stat_result, *, served: bool) -> Iterator[str]:
    """Yield the other processes that have a file open, but for whoever serves it if it is."""
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
