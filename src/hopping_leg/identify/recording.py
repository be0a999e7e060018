"""Recordings: measured joints and commands over time, and how they were recorded.

Native files are traces (Parquet) whose header holds the metadata; CSV and foreign Parquet files
need a sidecar, or come from one of the known rigs.
"""

import gzip
import hashlib
import re
import zlib
from dataclasses import asdict, dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from hopping_leg.arrays import Array, BoolArray
from hopping_leg.errors import RecordingError, UsageError, unknown_name
from hopping_leg.formats import bag_files, read_bag
from hopping_leg.identify import importers, recording_checks
from hopping_leg.identify.recording_format import (
    COLUMNS,
    PAIRS,
    RecordingMetadata,
    cast,
    float_column,
    sidecar_path,
)
from hopping_leg.io import parse_toml, read_dataclass
from hopping_leg.trace import Trace, read_parquet

_KEY, _PARQUET, _GZIP = "recording", b"PAR1", b"\x1f\x8b"
_BAGS = (".mcap", ".db3")
_UNREADABLE = (pl.exceptions.PolarsError, pl.exceptions.PanicException)


@dataclass(frozen=True)
class Recording:
    """One run of a rig."""

    trace: Trace
    """Table in the columns of ``COLUMNS`` and the header."""
    metadata: RecordingMetadata
    name: str
    digest: str = ""
    """SHA-256 of the file's bytes, hex."""
    warnings: tuple[str, ...] = ()
    """What the loader found strange but could live with, a sentence each."""

    def __len__(self) -> int:
        return self.trace.table.height

    @property
    def time(self) -> Array:
        """Time stamps, (ticks,), s."""
        return self.trace.column("time_s")

    @property
    def exact_time(self) -> BoolArray:
        """Where the time stamp is no guess, (ticks,)."""
        if not self.has_column("exact_time"):
            return np.ones(len(self), dtype=bool)
        return self.trace.table["exact_time"].fill_null(False).to_numpy()

    def has_column(self, column: str) -> bool:
        """Return whether a column was recorded."""
        return column in self.trace.table.columns

    def has(self, quantity: str) -> bool:
        """Return whether any value of a quantity of ``PAIRS`` was recorded."""
        return bool(np.isfinite(self.array(quantity)).any())

    def array(self, quantity: str) -> Array:
        """Return a quantity of ``PAIRS``, (ticks, 2), NaN if not recorded; others UsageError."""
        if quantity not in PAIRS:
            raise UsageError(unknown_name("quantity of a recording", quantity, PAIRS))
        return np.stack([float_column(self.trace.table, c) for c in PAIRS[quantity]], axis=-1)

    def segments(self) -> list[slice]:
        """Return the stretches of rows without a stall, in order."""
        stalls = recording_checks.stalls(self.time, self.metadata.period) + 1
        return [slice(a, b) for a, b in pairwise([0, *stalls.tolist(), len(self)])]

    @property
    def duration(self) -> float:
        """How long it is, s."""
        return float(self.time[-1] - self.time[0]) + self.metadata.period

    def part(self, start: int, stop: int) -> "Recording":
        """Return rows as a recording whose name says which seconds they are."""
        first, last = (float(self.time[row]) - self.time[0] for row in (start, stop - 1))
        name = f"{self.name}, {first:.1f}-{last:.1f} s"
        return replace(self.with_table(self.trace.table[int(start) : int(stop)]), name=name)

    def with_table(self, table: pl.DataFrame) -> "Recording":
        """Return the recording with another table, unchecked."""
        return replace(self, trace=replace(self.trace, table=table))

    def with_metadata(self, **changes: Any) -> "Recording":  # noqa: ANN401
        """Return the recording with other facts in its metadata, e.g. gains known elsewhere."""
        return replace(self, metadata=replace(self.metadata, **changes))

    def save(self, path: Path) -> None:
        """Write the native form, or raise TraceError if that fails."""
        tree = asdict(self.metadata).items()
        header = {**self.trace.header, _KEY: {k: v for k, v in tree if v is not None}}
        Trace(self.trace.table, header).save(path)


def make_recording(
    table: pl.DataFrame,
    metadata: RecordingMetadata,
    name: str,
    *,
    header: dict[str, Any] | None = None,
    digest: str = "",
) -> Recording:
    """Return a table in the columns of ``COLUMNS`` as a recording, or raise RecordingError."""
    table = cast(table, COLUMNS, name).with_columns(pl.selectors.float().fill_nan(None))
    inspection = recording_checks.Inspection(table, metadata, name)
    recording_checks.check_table(inspection)
    trace, warnings = Trace(inspection.table, header or {}), tuple(inspection.warnings)
    return Recording(trace, inspection.metadata, Path(name).name, digest, warnings)


def load_recording(path: str | Path) -> Recording:
    """Load native Parquet, a table or bag with a sidecar, ``run.toml``, or a known rig's log.

    RecordingError says which file, column and row cannot be read or believed.
    """
    path = Path(path)
    path = path.parent if path.name.partition(".")[0] in importers.LAB_FILES else path
    origin, sidecar = str(path), sidecar_path(path)
    table, header, digest = _read(path, origin)
    if sidecar != path and sidecar.is_file():
        table, metadata = _described(sidecar, table, origin)
    elif _KEY in header:
        metadata = _metadata(header.pop(_KEY), origin)
    else:
        table, metadata = importers.read_log(table, path)
    return make_recording(table, metadata, origin, header=header, digest=digest)


def _read(path: Path, origin: str) -> tuple[pl.DataFrame, dict[str, Any], str]:
    """Return a file's or bag's own table, its header, and the SHA-256 of its bytes."""
    logs = [p for name in importers.LAB_FILES for p in path.parent.glob(f"{path.name}/{name}.csv*")]
    bag = (path.is_dir() and not logs) or path.suffix in _BAGS
    try:
        files = logs or (bag_files(path) if bag else [path])
        content = b"".join(file.read_bytes() for file in files)
    except OSError as error:
        raise RecordingError(f"Cannot read the recording {path}: {error.strerror}.") from error
    if not files:
        raise RecordingError(f"{path} is a folder without .mcap or .db3 files, no bag.")
    digest = hashlib.sha256(content).hexdigest()
    if logs:
        tables = [_read_csv(file.read_bytes(), str(file)) for file in logs]
        return pl.concat(tables, how="horizontal"), {}, digest
    if bag:
        return read_bag(path, origin), {}, digest
    if content.startswith(_PARQUET):
        table, metadata = read_parquet(content, origin, RecordingError)
        native = "hopping_leg" in metadata
        return table, dict(Trace.of(table, metadata, path).header) if native else {}, digest
    return _read_csv(content, origin), {}, digest


def _read_csv(content: bytes, origin: str) -> pl.DataFrame:
    """Return a table from text, plain or gzip, with comma, semicolon, tab or blanks between fields.

    Columns of numbers, true and false are floats, empty fields null; lines after a # are skipped.
    """
    try:
        if content.startswith(_GZIP):
            content = gzip.decompress(content)
        if b"\0" in content:
            raise OSError("it holds zero bytes, as UTF-16, archives and torn files do")
        unquoted = re.sub(rb'"[^"\n]*"', b'""', content.removeprefix(b"\xef\xbb\xbf"))
        lines = [n.strip(b" ") for n in unquoted.splitlines() if n.strip() and n[:1] != b"#"]
        mark = next((m for m in b"\t;, " if m in b"".join(lines[:1])), ord(","))
        if mark == ord(" "):
            content = b"\n".join(b" ".join(n.split()) for n in content.splitlines())
        fields = [len(n.split(None if mark == ord(" ") else bytes([mark]))) for n in lines]
        if fields[1:] and fields[0] not in fields[1:]:
            raise RecordingError(
                f"{origin}: its rows have {fields[1]} fields, all others than the"
                f" {fields[0]} names of its header; name every field, and nothing else, there."
            )
        if short := [row for row, count in enumerate(fields, -1) if count < fields[0]]:
            raise RecordingError(
                f"{origin}: row {short[0]} has fewer fields than the {fields[0]} of the"
                " header, as a killed logger leaves it; delete the row."
            )
        texts = pl.read_csv(content, separator=chr(mark), comment_prefix="#", infer_schema=False)
    except (OSError, EOFError, zlib.error, *_UNREADABLE) as error:
        raise RecordingError(
            f"{origin} is no whole table of text ({str(error).partition(chr(10))[0]}); write its"
            " columns as CSV or Parquet, in SI units."
        ) from error
    names = pl.Series(texts.columns)
    if names.str.contains("_duplicated_").any() or names.cast(float, strict=False).count():
        raise RecordingError(
            f"{origin} has no header, or equal names; name each of its columns, without a #."
        )
    texts = texts.rename(str.strip).select(pl.all().str.strip_chars().replace("", None))
    flags = pl.all().str.to_lowercase().replace({"true": "1", "false": "0"})
    plain = flags.str.replace(",", "." if mark != ord(",") else ",", literal=True)
    numbers = texts.select(plain.cast(pl.Float64, strict=False))
    pairs = zip(numbers, texts, strict=True)
    return pl.DataFrame([n if n.null_count() == t.null_count() else t for n, t in pairs])


def _described(
    file: Path, table: pl.DataFrame, origin: str
) -> tuple[pl.DataFrame, RecordingMetadata]:
    """Name a table's columns as its sidecar says; return it and the metadata."""
    try:
        tree = parse_toml(file.read_bytes(), str(file), RecordingError)
    except OSError as error:
        raise RecordingError(f"Cannot read {file}: {error.strerror}.") from error
    names = tree.pop("columns", {})
    if not isinstance(names, dict) or not all(isinstance(v, str) for v in names.values()):
        raise RecordingError(
            f"{file}: [columns] must name the file's column for each of a recording's columns."
        )
    for new, old in names.items():
        if new not in COLUMNS:
            raise RecordingError(f"{file}: {unknown_name('recording column', new, COLUMNS)}")
        if old not in table.columns:
            raise RecordingError(f"{file}: {origin}: {unknown_name('column', old, table.columns)}")
    table = table.with_columns(pl.col(old).alias(new) for new, old in names.items())
    if "row" not in table.columns:
        table = table.with_columns(pl.int_range(pl.len()).alias("row"))
    return table, _metadata(tree, str(file))


def _metadata(tree: object, origin: str) -> RecordingMetadata:
    if isinstance(tree, dict):
        for name in ("quantisation", "effective_gravity"):  # in older recordings
            tree.pop(name, None)
    return read_dataclass(RecordingMetadata, tree, origin, error=RecordingError)
