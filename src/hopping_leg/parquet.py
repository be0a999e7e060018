"""Parquet files, of which none may end the process or take its memory.

polars believes what a file says of itself: a damaged one may panic, abort or ask for all memory. So
our own files hold their SHA-256, which tells damage, and any other one is read in a process of its
own first. A few bytes may hold many equal rows, in a whole file, too: those are counted first.
"""

import hashlib
import io
import os
import re
import subprocess
import sys

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
_TRIAL = """
import io, resource, sys
import polars as pl
content, most = sys.stdin.buffer.read(), int(sys.argv[1])
resource.setrlimit(resource.RLIMIT_AS, (2 * most, 2 * most))
try:
    pl.read_parquet_metadata(io.BytesIO(content))
    if pl.read_parquet(io.BytesIO(content)).estimated_size() > most:
        raise OSError(f"it takes more than {most >> 30} GiB")
except (pl.exceptions.PolarsError, OSError) as error:
    print(error)
    sys.exit(3)
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
    if complaint := "" if found and _is_small(content) else _try(content):
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


def _try(content: bytes) -> str:
    """Return what is wrong with a file, or nothing, as a process of its own finds out."""
    environment = {**os.environ, "POLARS_MAX_THREADS": "1", "RUST_BACKTRACE": "0"}
    words = [sys.executable, "-c", _TRIAL, str(MOST_MEMORY)]
    try:
        done = subprocess.run(
            words, input=content, capture_output=True, timeout=_SECONDS, env=environment
        )
    except subprocess.TimeoutExpired:
        return f"it takes more than {_SECONDS:g} s"
    if done.returncode == 0:
        return ""
    said = done.stdout.decode(errors="replace").partition("\n")[0].rstrip(".")
    return said if done.returncode == 3 and said else "it is damaged"
