"""Flight recordings: how `hop deploy` keeps a run on disk while it happens, and what reads them.

A file of frames, each ``kind, length, content, CRC-32``: one header (JSON), rows of floats, events
(JSON). A frame that was cut off, as the process was killed, is left out.
"""

import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from hopping_leg import errors, trace
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


def _frames(content: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield kind and content of every whole frame behind the magic to the first that is not."""
    at = len(MAGIC)
    while at + _FRAME.size <= len(content):
        kind, length = _FRAME.unpack_from(content, at)
        end = at + _FRAME.size + length + _CRC.size
        if length > _LARGEST or end > len(content):
            return
        (crc,) = _CRC.unpack_from(content, end - _CRC.size)
        if crc != zlib.crc32(content[at : end - _CRC.size]):
            return
        yield kind, content[at + _FRAME.size : end - _CRC.size]
        at = end


def recover(path: Path) -> trace.Trace:
    """Return the common trace of a run from its flight recording, also if it was killed.

    Columns that a trace may rely on and the recording lacks hold NaN. TraceError says that the
    file is missing, no flight recording, damaged, or holds no tick.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise errors.TraceError(f"Cannot read {path}: {error.strerror}.") from error
    if not content.startswith(MAGIC):
        raise errors.TraceError(f"{path} is no flight recording of `hop deploy`.")
    names: Any = ()
    header: Any = {}
    found, events = list[bytes](), list[dict[str, Any]]()
    for kind, data in _frames(content):
        if kind == HEADER and not names:
            first = parse_json(data, f"{path}: the header", errors.TraceError)
            names, header = first.get("columns"), first.get("header")
            named = isinstance(names, list) and names and all(isinstance(n, str) for n in names)
            if not (named and len({*names}) == len(names) and isinstance(header, dict)):
                raise errors.TraceError(f"{path} is damaged: its header names no columns.")
        elif kind == ROW and len(data) == 8 * len(names) > 0:
            found.append(data)
        elif kind == EVENT and names:
            events.append(parse_json(data, f"{path}: an event", errors.TraceError))
        else:
            raise errors.TraceError(f"{path} is damaged: it holds a frame of no known kind.")
    if not found:
        raise errors.TraceError(f"{path} holds no tick of a run.")
    rows = np.frombuffer(b"".join(found), "<f8").reshape(len(found), len(names))
    missing = [name for name in trace.COLUMNS if name not in names]
    table = pl.DataFrame(dict(zip(names, rows.T, strict=True))).with_columns(
        pl.lit(float("nan")).alias(name) for name in missing
    )
    return trace.Trace(table, {**header, "events": events})


def load_trace(path: Path) -> trace.Trace:
    """Return a stored trace, or that of a flight recording."""
    return recover(path) if path.suffix == SUFFIX else trace.Trace.load(path)
