"""Parquet files, of which none may end the process or take its memory.

polars believes what a file says of itself: a damaged one may panic, abort or ask for all memory. So
our own files hold their SHA-256, which tells damage, and any other one is read in another process
first. A few bytes may hold many equal rows, in a whole file, too: those are counted first.
"""

import atexit
import hashlib
import io
import json
import os
import re
import subprocess
import sys
import threading
import time

import polars as pl

from hopping_leg.errors import HoppingLegError

MOST_MEMORY = 2 << 30
"""Most that a table may take, bytes."""

_KEY = "hopping_leg_sha256"
_ZEROS = b"0" * 64
# A key, and its value of 64 characters, as the footer holds them (Thrift's compact protocol).
_DIGEST = re.compile(_KEY.encode() + rb"\x18\x40([0-9a-f]{64})")
_SECONDS = 120.0
_NUMBER = 8  # bytes
_READER = """
import io, json, resource, sys
import polars as pl
most = int(sys.argv[1])
resource.setrlimit(resource.RLIMIT_AS, (2 * most, 2 * most))
while size := int.from_bytes(sys.stdin.buffer.read(8), "little"):
    content, said = sys.stdin.buffer.read(size), ""
    try:
        pl.read_parquet_metadata(io.BytesIO(content))
        if pl.read_parquet(io.BytesIO(content)).estimated_size() > most:
            said = f"it takes more than {most >> 30} GiB"
    except (pl.exceptions.PolarsError, OSError) as error:
        said = str(error).partition("\\n")[0].rstrip(".") or "it is damaged"
    print(json.dumps(said), flush=True)
"""


def to_parquet(table: pl.DataFrame, metadata: dict[str, str]) -> bytes:
    """Return a table as a file with metadata and its own SHA-256, taken with zeros in its place."""
    buffer = io.BytesIO()
    table.write_parquet(buffer, metadata={**metadata, _KEY: _ZEROS.decode()})
    content = buffer.getvalue()
    at = [*_DIGEST.finditer(content)][-1].start(1)
    return content[:at] + hashlib.sha256(content).hexdigest().encode() + content[at + 64 :]


def read_parquet(
    content: bytes, origin: str, error: type[HoppingLegError]
) -> tuple[pl.DataFrame, dict[str, str]]:
    """Return a file's table and metadata; ``error`` says that it is damaged or too large."""
    found = [*_DIGEST.finditer(content)]
    if found:
        at = found[-1].start(1)
        zeroed = content[:at] + _ZEROS + content[at + 64 :]
        if hashlib.sha256(zeroed).hexdigest().encode() != found[-1][1]:
            raise error(f"{origin} is not a readable Parquet file: its checksum does not fit.")
    if complaint := "" if found and _is_small(content) else _reader.complaint(content):
        raise error(f"{origin} is not a readable Parquet file: {complaint}.")
    metadata = pl.read_parquet_metadata(io.BytesIO(content))
    return pl.read_parquet(io.BytesIO(content)), metadata


def _is_small(content: bytes) -> bool:
    """Tell whether a whole file holds numbers alone, no more of them than may be."""
    kinds = pl.read_parquet_schema(io.BytesIO(content)).values()
    if not all(kind.is_numeric() or kind == pl.Boolean for kind in kinds):
        return False
    rows: int = pl.scan_parquet(io.BytesIO(content)).select(pl.len()).collect().item()
    return rows * len(kinds) * _NUMBER <= MOST_MEMORY


class _Reader:
    """A process that reads files first; one that a file has ended is followed by another."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._owner = 0  # a fork must not share it
        self._lock = threading.Lock()
        atexit.register(self._end)

    def complaint(self, content: bytes) -> str:
        """Return what is wrong with a file, or nothing."""
        if not content:
            return "it is empty"
        with self._lock:
            process = self._running()
            begin, said = time.monotonic(), b""
            timer = threading.Timer(_SECONDS, process.kill)
            timer.start()
            try:
                said = _ask(process, content)
            finally:
                timer.cancel()
                if not said:
                    self._end()
            if said:
                return str(json.loads(said))
            late = time.monotonic() - begin >= _SECONDS
            return f"it takes more than {_SECONDS:g} s" if late else "it is damaged"

    def _running(self) -> subprocess.Popen[bytes]:
        process = self._process
        if process is None or self._owner != os.getpid() or process.poll() is not None:
            process = _start_reader()
            self._process, self._owner = process, os.getpid()
        return process

    def _end(self) -> None:
        if self._process is not None and self._owner == os.getpid():
            self._process.kill()
            self._process.communicate()
        self._process = None


def _start_reader() -> subprocess.Popen[bytes]:
    environment = {**os.environ, "POLARS_MAX_THREADS": "1", "RUST_BACKTRACE": "0"}
    words = [sys.executable, "-c", _READER, str(MOST_MEMORY)]
    pipe = subprocess.PIPE
    return subprocess.Popen(
        words, stdin=pipe, stdout=pipe, stderr=subprocess.DEVNULL, env=environment
    )


def _ask(process: subprocess.Popen[bytes], content: bytes) -> bytes:
    """Return what a reader says of a file; nothing if that has ended it."""
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        process.stdin.write(len(content).to_bytes(8, "little") + content)
        process.stdin.flush()
    except BrokenPipeError:
        return b""
    said = process.stdout.readline()
    return said if said.endswith(b"\n") else b""


_reader = _Reader()
