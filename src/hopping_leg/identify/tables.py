"""Reading a CSV of a recording, plain or gzip, so that errors name row and column."""

import csv
import gzip
import io
import zlib
from collections.abc import Iterator
from pathlib import Path

import polars as pl

from hopping_leg.errors import RecordingError

TEXT_COLUMNS = {"phase"}
"""Columns that hold words."""

FLAGS = {"true": 1.0, "false": 0.0}
_PARQUET = b"PAR1"
_GZIP = b"\x1f\x8b"


def read_bytes(path: Path) -> bytes:
    """Return a file's content.

    Raises:
        RecordingError: It is missing, unreadable or empty.
    """
    try:
        content = path.read_bytes()
    except FileNotFoundError as error:
        raise RecordingError(f"There is no recording {path}.") from error
    except OSError as error:
        raise RecordingError(f"Cannot read the recording {path}: {error.strerror}.") from error
    if not content:
        raise RecordingError(f"{path} is empty; record again.")
    return content


def is_parquet(content: bytes) -> bool:
    """Return whether a file's content begins like Parquet."""
    return content.startswith(_PARQUET)


def read_csv(content: bytes, origin: str) -> pl.DataFrame:
    """Return a CSV's table, numbers as floats, empty fields and NaN as null.

    Args:
        content: The file's bytes, gzip or plain, UTF-8.
        origin: The file, for messages.

    Raises:
        RecordingError: Naming file, column and row of what is wrong.
    """
    rows = _rows(_text(content, origin), origin)
    header = [name.strip() for name in next(rows, [])]
    if not header:
        raise RecordingError(f"{origin} is empty; record again.")
    for name in header:
        if not name or header.count(name) > 1:
            raise RecordingError(
                f"{origin}: the header's column '{name}' is nameless or there twice;"
                " give every column its own name."
            )
    body: list[list[str]] = []
    for row in rows:
        if len(row) != len(header):
            raise RecordingError(
                f"{origin}: row {len(body)} has {len(row)} fields but the header names"
                f" {len(header)} (column '{header[min(len(row), len(header) - 1)]}');"
                " a logger that was killed leaves such a row, delete it."
            )
        body.append(row)
    columns = zip(*body, strict=True) if body else ([] for _ in header)
    return pl.DataFrame([_parse(n, list(c), origin) for n, c in zip(header, columns, strict=True)])


def as_numbers(table: pl.DataFrame, origin: str) -> pl.DataFrame:
    """Return a foreign table with numbers as floats and words where words belong.

    Raises:
        RecordingError: Naming file and column of what is neither.
    """
    columns = []
    for column in table.get_columns():
        kind = pl.String if column.name in TEXT_COLUMNS else pl.Float64
        try:
            columns.append(column.cast(kind))
        except pl.exceptions.PolarsError as error:
            raise RecordingError(
                f"{origin}: column '{column.name}' holds {column.dtype} but must hold {kind}."
            ) from error
    return pl.DataFrame(columns)


def _text(content: bytes, origin: str) -> str:
    if content.startswith(_GZIP):
        try:
            content = gzip.decompress(content)
        except (OSError, EOFError, zlib.error) as error:
            raise RecordingError(f"{origin} is not a whole gzip file: {error}.") from error
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise RecordingError(
            f"{origin} is neither Parquet nor a CSV in UTF-8: byte {error.start} is no text."
        ) from error


def _rows(text: str, origin: str) -> Iterator[list[str]]:
    reader = csv.reader(io.StringIO(text, newline=""))
    try:
        yield from (row for row in reader if row)
    except csv.Error as error:
        raise RecordingError(f"{origin}: line {reader.line_num} is not CSV: {error}.") from error


def _parse(name: str, texts: list[str], origin: str) -> pl.Series:
    words = pl.Series(name, texts, dtype=pl.String).str.strip_chars()
    words = words.set(words == "", None)
    if name in TEXT_COLUMNS:
        return words
    numbers = words.cast(pl.Float64, strict=False)
    strange = (words.is_not_null() & numbers.is_null()).arg_true()
    if strange.len() == 0:
        return numbers.fill_nan(None)
    flags = words.str.to_lowercase().replace_strict(FLAGS, default=None, return_dtype=pl.Float64)
    numbers = numbers.zip_with(numbers.is_not_null(), flags)
    for row in strange:
        if numbers[row] is None:
            text = words[row] if len(words[row]) <= 20 else f"{words[row][:20]}..."
            raise RecordingError(f"{origin}: column '{name}', row {row}: {text!r} is no number.")
    return numbers.fill_nan(None)
