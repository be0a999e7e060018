"""The one record of a run, shared by simulation and hardware: a table of ticks and a header.

Stored as Parquet with the header in the file's metadata; nothing is ever unpickled.
"""

import atexit
import contextlib
import io
import json
import subprocess
import sys
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from hopping_leg.arrays import Array
from hopping_leg.errors import Error, TraceError
from hopping_leg.io import parse_json, write_atomically

SCHEMA = 1  # Version of the layout, stored in every header

COLUMNS = {
    "time_s": "start of the control period",
    "command_m": "desired apex height of the base",
    "height_m": "true base height; on hardware as measured, if it is",
    "height_rate_m_s": "true base velocity; missing on hardware",
    "hip_position_rad": "true joint position, measured on hardware",
    "knee_position_rad": "true joint position, measured on hardware",
    "hip_velocity_rad_s": "true joint velocity, measured on hardware",
    "knee_velocity_rad_s": "true joint velocity, measured on hardware",
    "hip_command_nm": "joint torque the controller asked for",
    "knee_command_nm": "joint torque the controller asked for",
    "hip_torque_nm": "joint torque the motor gave",
    "knee_torque_nm": "joint torque the motor gave",
    "foot_clearance_m": "gap between foot and ground, negative when sunk in",
    "knee_clearance_m": "gap between knee and ground",
    "base_clearance_m": "gap between base and ground",
}
"""Every column a trace may rely on; controllers may add their own."""


def interpolated(name: str) -> pl.Expr:
    """Return a column with its gaps, NaN or null, filled by up to ten ticks of a straight line."""
    known = pl.col(name).cast(pl.Float64, strict=False).fill_nan(None)
    return pl.when(known.forward_fill(10).is_not_null()).then(known.interpolate())


_READER = """import io, polars, sys
while size := int(sys.stdin.buffer.readline() or 0):
    polars.read_parquet(io.BytesIO(sys.stdin.buffer.read(size)))
    print(flush=True)
"""


@cache
def _reader() -> subprocess.Popen[bytes]:
    words, pipe = [sys.executable, "-P", "-c", _READER], subprocess.PIPE
    reader = subprocess.Popen(words, stdin=pipe, stdout=pipe, stderr=subprocess.DEVNULL)
    atexit.register(reader.communicate)
    return reader


def read_parquet(content: bytes, origin: str, error: Error) -> tuple[pl.DataFrame, dict[str, str]]:
    """Return a Parquet file's table and metadata; ``error`` says that it is damaged.

    Another process reads it first: polars may end the one that reads a damaged file.
    """
    reader = _reader()
    with contextlib.suppress(pl.exceptions.PolarsError, pl.exceptions.PanicException, OSError):
        if reader.stdin and reader.stdout:
            reader.stdin.write(b"%d\n%b" % (len(content), content))
            reader.stdin.flush()
            if reader.stdout.readline():
                metadata = pl.read_parquet_metadata(io.BytesIO(content))
                return pl.read_parquet(io.BytesIO(content)), metadata
    _reader.cache_clear()
    raise error(f"{origin} is not a readable Parquet file: it is damaged, or of another kind.")


@dataclass(frozen=True)
class Trace:
    """One leg's run."""

    table: pl.DataFrame
    """One row per control period, columns as in ``COLUMNS``."""
    header: dict[str, Any] = field(default_factory=dict)
    """Robot, its digest, controller, seed, rate, versions."""

    def column(self, name: str) -> Array:
        """Return a column as floats, (ticks,); TraceError if it is missing or holds no numbers."""
        if name not in self.table.columns:
            raise TraceError(
                f"The trace has no column '{name}'; it has: {', '.join(self.table.columns)}."
            )
        try:
            return self.table[name].to_numpy().astype(np.float64)
        except (TypeError, ValueError) as error:
            raise TraceError(f"The trace's column '{name}' holds no numbers.") from error

    def require_ticks(self, path: Path) -> None:
        """Raise TraceError that names a file unless it has two ticks or more, at rising times."""
        steps = np.diff(self.column("time_s"))
        if not (len(steps) and steps.min() > 0 and np.isfinite(steps).all()):
            raise TraceError(f"{path} holds no ticks in a row: its 'time_s' must rise.")

    def save(self, path: Path) -> None:
        """Write the trace; an existing file is replaced only once the new one is complete."""
        header = json.dumps({"schema": SCHEMA, **self.header}, sort_keys=True)
        file = io.BytesIO()
        self.table.write_parquet(file, metadata={"hopping_leg": header})
        write_atomically(path, file.getvalue())

    @staticmethod
    def load(path: Path) -> "Trace":
        """Read a trace; TraceError where it is missing, truncated, foreign or of another schema."""
        try:
            content = path.read_bytes()
        except OSError as error:
            raise TraceError(f"Cannot read the trace {path}: {error.strerror}.") from error
        return Trace.of(*read_parquet(content, str(path), TraceError), path)

    @staticmethod
    def of(table: pl.DataFrame, metadata: dict[str, str], path: Path) -> "Trace":
        """Return the trace that a Parquet file's table and metadata hold, as ``load`` does."""
        if "hopping_leg" not in metadata:
            raise TraceError(
                f"{path} is a Parquet file but not a trace;"
                " record one with `hop evaluate --out DIR`."
            )
        header = parse_json(metadata["hopping_leg"], f"{path}: its header", TraceError)
        schema = header.pop("schema", None)
        if schema != SCHEMA:
            raise TraceError(
                f"{path} has trace schema {schema}; this version reads schema {SCHEMA}."
            )
        return Trace(table, header)
