"""The flight recorder: a run, tick by tick, on disk while it happens, see ``flight_recording``.

The loop only puts a frame into a queue; a thread writes it at once. When the process is killed, all
but the very last frames are in the file. What a full disk refuses waits in memory until there is
room, so that nothing is left out.
"""

import errno
import json
import os
import queue
import struct
import threading
from collections import deque
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hopping_leg import errors
from hopping_leg.flight_recording import EVENT, HEADER, MAGIC, ROW, frame

_SYNC_TICKS = 200
_WAITING = 1 << 26  # Most that waits in memory for a full disk, bytes: a quarter of an hour


class FlightRecorder:
    """Writes one run; rows and events never wait for the disk, unless time is virtual.

    It writes in a thread; in virtual time, where nothing is late, that only costs time. TraceError
    says that the file exists or cannot be created.

    Attributes:
        rows: How many were recorded.
        lost: How many frames are not in the file; known once it is closed.
        error: What the disk said last when it refused something, None if it never did.
    """

    def __init__(
        self, path: Path, columns: Sequence[str], header: dict[str, Any], *, threaded: bool = True
    ) -> None:
        self.path, self.columns = path, tuple(columns)
        self.rows = self.lost = 0
        self.error: str | None = None
        self._row = struct.Struct(f"<{len(self.columns)}d")
        facts = {"columns": self.columns, "header": header}
        first = MAGIC + frame(HEADER, json.dumps(facts).encode())
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o644)
        except OSError as error:
            raise errors.TraceError(f"Cannot create {error.filename}: {error.strerror}.") from error
        try:
            if os.write(self._file, first) < len(first):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        except OSError as error:
            os.close(self._file)
            path.unlink()
            raise errors.TraceError(f"Cannot write {path}: {error.strerror}.") from error
        self._waiting: deque[bytes] = deque()
        self._size = self._unsynced = self._begun = 0
        self._queue: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
        self._thread: threading.Thread | None = None
        if threaded:
            self._thread = threading.Thread(target=self._work, name="black-box", daemon=True)
            self._thread.start()

    def row(self, values: Sequence[float]) -> None:
        """Record a tick; ``values`` are in the order of ``columns``."""
        self.rows += 1
        self._put(frame(ROW, self._row.pack(*values)))

    def event(self, **facts: Any) -> None:  # noqa: ANN401
        """Record what happened beside the ticks, e.g. a transition with its reason."""
        self._put(frame(EVENT, json.dumps(facts).encode()))

    def close(self) -> None:
        """Write what is left and close the file."""
        self._put(None)
        if self._thread:
            self._thread.join()
        self.lost += len(self._waiting)
        os.close(self._file)

    def _put(self, framed: bytes | None) -> None:
        self._queue.put(framed)
        if self._thread is None:
            self._write()

    def _work(self) -> None:
        """Write frames as they come, until the last."""
        while self._write():
            pass

    def _write(self) -> bool:
        """Write what comes next behind all that waits; return whether there is more to come."""
        taken = self._queue.get()
        while taken is not None:
            if self._size + len(taken) > _WAITING:
                self.lost += 1
            else:
                self._waiting.append(taken)
                self._size += len(taken)
            try:
                taken = self._queue.get_nowait()
            except queue.Empty:
                break
        try:
            while self._waiting:
                written = os.write(self._file, self._waiting[0][self._begun :])
                self._begun, self._size = self._begun + written, self._size - written
                if self._begun == len(self._waiting[0]):
                    self._waiting.popleft()
                    self._begun, self._unsynced = 0, self._unsynced + 1
            if taken is None or self._unsynced >= _SYNC_TICKS:
                os.fsync(self._file)
                self._unsynced = 0
        except OSError as error:
            self.error = f"{self.path}: {error.strerror}"
        return taken is not None
