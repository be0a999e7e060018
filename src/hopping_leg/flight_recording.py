"""Flight recordings: how `hop deploy` keeps a run on disk while it happens, and what reads them.

A file of frames, each ``kind, length, content, CRC-32``: one header (JSON), rows of floats, events
(JSON). A frame that was cut off, as the process was killed, is left out.
"""

import contextlib
import os
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from hopping_leg import errors, trace
from hopping_leg.arrays import Array
from hopping_leg.io import parse_json

HEADER, ROW, EVENT = range(3)  # Kinds of frames

SUFFIX = ".blackbox"  # End of the files' names
MAGIC = b"HOPBOX1\n"  # What every file begins with

_FRAME = struct.Struct("<BI")
_CRC = struct.Struct("<I")
_LARGEST = 1 << 24  # Content that no frame exceeds, bytes; a length beyond it is damage


def frame(kind: int, content: bytes) -> bytes:
    """Return a frame of a kind."""
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


class FlightRecorderTail:
    """Reads what is new in a flight recording; TraceError says that it cannot be read.

    Attributes:
        columns: Names of the rows' values; empty until the header is there.
        header: Facts about the run; empty until the header is there.
        events: So far, in order.
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

    def rows(self) -> Array:
        """Return the rows since the last call, (ticks, columns); TraceError for any other file."""
        content = self._rest + self._file.read()
        at = 0
        if not self._begun:
            if not content.startswith(MAGIC[: len(content)]):
                raise errors.TraceError(f"{self.path} is no flight recording of `hop deploy`.")
            if len(content) < len(MAGIC):
                self._rest = content
                return np.empty((0, 0))
            at, self._begun = len(MAGIC), True
        found = []
        for kind, data, end in _frames(content, at):
            at = end
            if kind == HEADER and not self.columns:
                first = parse_json(data, f"{self.path}: the header", errors.TraceError)
                names: Any = first.get("columns")
                header: Any = first.get("header")
                named = isinstance(names, list) and names and all(isinstance(n, str) for n in names)
                if not (named and len({*names}) == len(names) and isinstance(header, dict)):
                    raise errors.TraceError(f"{self.path} is damaged: its header names no columns.")
                self.columns, self.header = tuple(names), header
            elif kind == ROW and len(data) == 8 * len(self.columns) > 0:
                found.append(data)
            elif kind == EVENT and self.columns:
                self.events.append(parse_json(data, f"{self.path}: an event", errors.TraceError))
            else:
                raise errors.TraceError(
                    f"{self.path} is damaged: it holds a frame of no known kind."
                )
        self._rest = content[at:]
        return np.frombuffer(b"".join(found), "<f8").reshape(len(found), len(self.columns))

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def recover(path: Path) -> trace.Trace:
    """Return the common trace of a run from its flight recording, also if it was killed.

    Columns that a trace may rely on and the recording lacks hold NaN. TraceError says that the
    file is missing, no flight recording, or holds no tick.
    """
    with contextlib.closing(FlightRecorderTail(path)) as box:
        rows = box.rows()
    if not len(rows):
        raise errors.TraceError(f"{path} holds no tick of a run.")
    missing = [name for name in trace.COLUMNS if name not in box.columns]
    table = pl.DataFrame(dict(zip(box.columns, rows.T, strict=True))).with_columns(
        pl.lit(float("nan")).alias(name) for name in missing
    )
    return trace.Trace(table, {**box.header, "events": box.events})


def load_trace(path: Path) -> trace.Trace:
    """Return a stored trace, or that of a flight recording."""
    return recover(path) if path.suffix == SUFFIX else trace.Trace.load(path)
