"""The flight recorder: what happened, tick by tick, on disk while it happens.

A file of frames, each ``kind, length, content, CRC-32``: one header (JSON), rows of floats, events
(JSON). The loop only puts a frame into a queue; a thread writes it at once. When the process is
killed, all but the very last frames are in the file, and a frame that was cut off is left out.
What a full disk refuses waits in memory until there is room, so that nothing is left out.
"""

import contextlib
import errno
import json
import os
import queue
import struct
import threading
import zlib
from collections import deque
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from hopping_leg import errors, trace
from hopping_leg.arrays import Array
from hopping_leg.io import parse_json

_HEADER, _ROW, _EVENT = range(3)  # Kinds of frames

SUFFIX = ".blackbox"
"""End of the files' names."""

_MAGIC = b"HOPBOX1\n"  # What every file begins with
_FRAME = struct.Struct("<BI")
_CRC = struct.Struct("<I")
_SYNC_TICKS = 200
_WAITING = 1 << 26  # Most that waits in memory for a full disk, bytes: a quarter of an hour
_LARGEST = 1 << 24  # Content that no frame exceeds, bytes; a length beyond it is damage


class FlightRecorder:
    """Writes one run; rows and events never wait for the disk, unless time is virtual.

    Args:
        path: File to create; ends in ``SUFFIX``.
        columns: Names of the rows' values.
        header: Facts about the run, JSON.
        threaded: Write in a thread; in virtual time, where nothing is late, it only costs time.

    Attributes:
        rows: How many were recorded.
        lost: How many frames are not in the file; known once it is closed.
        error: What the disk said last when it refused something, None if it never did.

    Raises:
        TraceError: The file exists or cannot be created.
    """

    def __init__(
        self, path: Path, columns: Sequence[str], header: dict[str, Any], *, threaded: bool = True
    ) -> None:
        self.path, self.columns = path, tuple(columns)
        self.rows = self.lost = 0
        self.error: str | None = None
        self._row = struct.Struct(f"<{len(self.columns)}d")
        facts = {"columns": self.columns, "header": header}
        first = _MAGIC + _frame(_HEADER, json.dumps(facts).encode())
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o644)
        except OSError as error:
            raise errors.TraceError(f"Cannot create {path}: {error.strerror}.") from error
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
        self._put(_frame(_ROW, self._row.pack(*values)))

    def event(self, **facts: Any) -> None:  # noqa: ANN401
        """Record what happened beside the ticks, e.g. a transition with its reason."""
        self._put(_frame(_EVENT, json.dumps(facts).encode()))

    def close(self) -> None:
        """Write what is left and close the file."""
        self._put(None)
        if self._thread:
            self._thread.join()
        self.lost += len(self._waiting)
        os.close(self._file)

    def _put(self, frame: bytes | None) -> None:
        self._queue.put(frame)
        if self._thread is None:
            self._write()

    def _work(self) -> None:
        """Write frames as they come, until the last."""
        while self._write():
            pass

    def _write(self) -> bool:
        """Write what comes next, and all that waits; return whether there is more to come.

        What the disk refuses waits, in its order.
        """
        frame = self._queue.get()
        while frame is not None:
            if self._size + len(frame) > _WAITING:
                self.lost += 1
            else:
                self._waiting.append(frame)
                self._size += len(frame)
            try:
                frame = self._queue.get_nowait()
            except queue.Empty:
                break
        try:
            while self._waiting:
                written = os.write(self._file, self._waiting[0][self._begun :])
                self._begun, self._size = self._begun + written, self._size - written
                if self._begun == len(self._waiting[0]):
                    self._waiting.popleft()
                    self._begun, self._unsynced = 0, self._unsynced + 1
            if frame is None or self._unsynced >= _SYNC_TICKS:
                os.fsync(self._file)
                self._unsynced = 0
        except OSError as error:
            self.error = f"{self.path}: {error.strerror}"
        return frame is not None


class FlightRecorderTail:
    """Reads what is new in a flight recording.

    Args:
        path: The file.

    Attributes:
        columns: Names of the rows' values; empty until the header is there.
        header: Facts about the run; empty until the header is there.
        events: So far, in order.

    Raises:
        TraceError: The file cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.columns: tuple[str, ...] = ()
        self.header: dict[str, Any] = {}
        self.events: list[dict[str, Any]] = []
        self._rest, self._begun = b"", False
        try:
            self._file = path.open("rb", buffering=0)
        except OSError as error:
            raise errors.TraceError(f"Cannot read {path}: {error.strerror}.") from error

    @property
    def over(self) -> bool:
        """Whether the file is gone: the run has ended and left its trace."""
        return os.fstat(self._file.fileno()).st_nlink == 0

    @property
    def whole(self) -> bool:
        """Whether what was read ends with a whole frame."""
        return not self._rest

    def rows(self) -> Array:
        """Return the rows that were written since the last call, (ticks, columns).

        Raises:
            TraceError: The file is no flight recording.
        """
        content = self._rest + self._file.read()
        at = 0
        if not self._begun:
            if not content.startswith(_MAGIC[: len(content)]):
                raise errors.TraceError(f"{self.path} is no flight recording of `hop deploy`.")
            if len(content) < len(_MAGIC):
                self._rest = content
                return np.empty((0, 0))
            at, self._begun = len(_MAGIC), True
        found = []
        for kind, data, end in _frames(content, at):
            at = end
            if kind == _HEADER and not self.columns:
                self._read_header(data)
            elif kind == _ROW and len(data) == 8 * len(self.columns) > 0:
                found.append(data)
            elif kind == _EVENT and self.columns:
                self.events.append(parse_json(data, f"{self.path}: an event", errors.TraceError))
            else:
                raise errors.TraceError(
                    f"{self.path} is damaged: it holds a frame of no known kind."
                )
        self._rest = content[at:]
        return np.frombuffer(b"".join(found), "<f8").reshape(len(found), len(self.columns))

    def _read_header(self, data: bytes) -> None:
        first = parse_json(data, f"{self.path}: the header", errors.TraceError)
        names: Any = first.get("columns")
        header: Any = first.get("header")
        named = isinstance(names, list) and names and all(isinstance(n, str) for n in names)
        if not (named and len({*names}) == len(names) and isinstance(header, dict)):
            raise errors.TraceError(f"{self.path} is damaged: its header names no columns.")
        self.columns, self.header = tuple(names), header

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def read_recording(path: Path) -> tuple[FlightRecorderTail, Array]:
    """Return a flight recording and its rows, (ticks, columns), also of a process that was killed.

    Raises:
        TraceError: The file is missing, or no flight recording.
    """
    with contextlib.closing(FlightRecorderTail(path)) as box:
        rows = box.rows()
    if not box.columns:
        raise errors.TraceError(f"{path} ends before its header; the run had not begun.")
    return box, rows


def recover(path: Path) -> trace.Trace:
    """Return the common trace of a run from its flight recording.

    Columns of the true height, which hardware does not know, hold NaN.

    Raises:
        TraceError: The file is missing, no flight recording, or holds no tick.
    """
    box, rows = read_recording(path)
    if not len(rows):
        raise errors.TraceError(f"{path} holds no tick; the run had not begun.")
    unknown = ("height_m", "height_rate_m_s")
    clearances = tuple(f"{part}_clearance_m" for part in ("foot", "knee", "base"))
    missing = [name for name in (*unknown, *clearances) if name not in box.columns]
    table = pl.DataFrame(dict(zip(box.columns, rows.T, strict=True))).with_columns(
        pl.lit(float("nan")).alias(name) for name in missing
    )
    return trace.Trace(table, {**box.header, "events": box.events})


def _frame(kind: int, content: bytes) -> bytes:
    head = _FRAME.pack(kind, len(content))
    return head + content + _CRC.pack(zlib.crc32(content, zlib.crc32(head)))


def _frames(content: bytes, at: int) -> Iterator[tuple[int, bytes, int]]:
    """Yield kind, content and end of every whole frame from ``at`` to the first that is not."""
    while at + _FRAME.size <= len(content):
        kind, length = _FRAME.unpack_from(content, at)
        end = at + _FRAME.size + length + _CRC.size
        if length > _LARGEST or end > len(content):
            return
        (crc,) = _CRC.unpack_from(content, end - _CRC.size)
        if crc != zlib.crc32(content[at : end - _CRC.size]):
            return
        yield kind, content[at + _FRAME.size : end - _CRC.size], end
        at = end
