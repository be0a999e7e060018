"""Tables from text: CSV in the dialects that loggers and spreadsheets write, and what is no text.

Comma, semicolon, tab or blanks between fields, a decimal point or comma, comment lines, numpy's
header behind a ``#``, a row of SI units; plain or gzip.
"""

import csv
import gzip
import io
import zlib

import polars as pl

from hopping_leg.errors import RecordingError
from hopping_leg.identify.recording_format import COLUMNS

_FLAGS = {"true": 1.0, "false": 0.0}
_GZIP = b"\x1f\x8b"
_MOST_TEXT = 1 << 28  # bytes
_FOREIGN = {
    b"MATLAB": "a MATLAB file (.mat)",
    b"\x89HDF": "an HDF5 file, as .mat files of MATLAB 7.3 are",
    b"\x93NUMPY": "a numpy array (.npy)",
    b"PK\x03\x04": "a zip archive, as .npz and .xlsx files are",
    b"\x80": "a Python pickle, which could run anything and is never opened",
    b"#ROSBAG": "a bag of ROS 1; `rosbags-convert` makes it one of ROS 2",
    b"ARROW1": "an Arrow file",
    b"BZh": "a bzip2 archive",
    b"\xfd7zXZ": "an xz archive",
    b"\x28\xb5\x2f\xfd": "a zstd archive",
}
"""What other files begin with."""
_UNITS = {"", "-", "1", "s", "sec", "rad", "rad/s", "nm", "n*m", "m", "bool"}
"""Units that need no conversion, without blanks, dots and brackets."""


def read_csv(content: bytes, origin: str) -> pl.DataFrame:
    """Return a table of numbers as floats, empty fields and NaN as null.

    Raises:
        RecordingError: It is no such table; the sentence names column and row.
    """
    comments: list[str] = []
    lines: list[str] = []
    for line in _text(content, origin).splitlines():
        if line.lstrip().startswith(("#", "%", "//")):
            comments.append(line.strip())
        elif line.strip() and not line.lower().startswith("sep="):  # for spreadsheets
            lines.append(line.strip(" "))  # a tab at either end stands beside an empty field
    if not lines:
        raise RecordingError(f"{origin} is empty; record again.")
    mark = _mark(lines[0].strip())
    rows = _split(lines, mark, origin)
    if _numeric(rows[0]):  # numpy.savetxt writes its header as a comment
        headers = (_split([c.lstrip("#%/ ")], _mark(c), origin) for c in reversed(comments))
        rows[:0] = next((h for h in headers if h and len(h[0]) == len(rows[0])), [])
    header, body = _without_last_mark(rows)
    if _numeric(header):
        raise RecordingError(f"{origin} has no header, it begins with numbers; name its columns.")
    for name in header:
        if not name or header.count(name) > 1:
            raise RecordingError(
                f"{origin}: the header's column '{name}' is nameless or there twice;"
                " give every column its own name."
            )
    for number, row in enumerate(body):
        if len(row) != len(header):
            raise RecordingError(
                f"{origin}: row {number} has {len(row)} fields but the header names"
                f" {len(header)} (column '{header[min(len(row), len(header) - 1)]}');"
                " a logger that was killed leaves such a row, delete it."
            )
    if body and _holds_units(header, body[0], origin):
        del body[0]
    texts = pl.DataFrame(body, schema=dict.fromkeys(header, pl.String), orient="row")
    return pl.DataFrame([_parse(column, origin, comma=mark != ",") for column in texts])


def _text(content: bytes, origin: str) -> str:
    if content.startswith(_GZIP):
        try:
            with gzip.open(io.BytesIO(content)) as file:
                content = file.read(_MOST_TEXT + 1)
        except (OSError, EOFError, zlib.error) as error:
            raise RecordingError(f"{origin} is not a whole gzip file: {error}.") from error
    if len(content) > _MOST_TEXT:
        raise RecordingError(
            f"{origin} holds more than {_MOST_TEXT >> 20} MiB of text; cut it into shorter ones."
        )
    for beginning, kind in _FOREIGN.items():
        if content.startswith(beginning):
            raise RecordingError(
                f"{origin} is {kind}; write its columns as CSV or Parquet, in SI units."
            )
    wide = content.startswith((b"\xff\xfe", b"\xfe\xff"))
    try:
        return content.decode("utf-16" if wide else "utf-8-sig")
    except UnicodeDecodeError as error:
        raise RecordingError(
            f"{origin} is neither Parquet nor a CSV in UTF-8: byte {error.start} is no text."
        ) from error


def _mark(line: str) -> str:
    """Return what stands between a line's fields."""
    return next((mark for mark in "\t;," if mark in line), " ")


def _split(lines: list[str], mark: str, origin: str) -> list[list[str]]:
    reader = csv.reader(lines, delimiter=mark, skipinitialspace=mark == " ")
    try:
        return [row for row in reader if row]
    except csv.Error as error:
        raise RecordingError(f"{origin}: line {reader.line_num} is not CSV: {error}.") from error


def _without_last_mark(rows: list[list[str]]) -> tuple[list[str], list[list[str]]]:
    """Return header and rows without the empty field that a mark at a line's end leaves."""
    header = [name.strip() for name in rows[0]]
    if len(header) > 1 and not header[-1]:
        header.pop()
    longer = len(header) + 1
    cut = [r[:-1] if len(r) == longer and not r[-1].strip() else r for r in rows[1:]]
    return header, cut


def _is_number(text: str) -> bool:
    try:
        float(text.replace(",", "."))
    except ValueError:
        return False
    return True


def _numeric(fields: list[str]) -> bool:
    """Return whether a line holds numbers only, some of which may be missing."""
    known = [field for field in fields if field.strip()]
    return bool(known) and all(map(_is_number, known))


def _holds_units(header: list[str], row: list[str], origin: str) -> bool:
    """Return whether a row below the header holds SI units; refuse it if it holds others."""
    if any(map(_is_number, row)) or any(field.strip().lower() in _FLAGS for field in row):
        return False
    for name, field in zip(header, row, strict=True):
        unit = field.lower().translate(dict.fromkeys(map(ord, " []()\u00b7\u22c5.")))
        if unit not in _UNITS and COLUMNS.get(name) is not pl.String:
            raise RecordingError(
                f"{origin}: column '{name}', row 0: {field[:20]!r} is no number; if the row holds"
                " units, convert to SI and delete it."
            )
    return any(field.strip() for field in row)


def _parse(texts: pl.Series, origin: str, *, comma: bool) -> pl.Series:
    words = texts.str.strip_chars()
    words = words.set(words == "", None)
    if COLUMNS.get(words.name) is pl.String:
        return words
    if comma:
        words = words.str.replace(r"^([+-]?\d*),(\d)", "$1.$2")
    numbers = words.cast(pl.Float64, strict=False)
    strange = (words.is_not_null() & numbers.is_null()).arg_true()
    if strange.len() == 0:
        return numbers.fill_nan(None)
    flags = words.str.to_lowercase().replace_strict(_FLAGS, default=None, return_dtype=pl.Float64)
    numbers = numbers.zip_with(numbers.is_not_null(), flags)
    for row in strange:
        if numbers[row] is None:
            text = words[row] if len(words[row]) <= 20 else f"{words[row][:20]}..."
            raise RecordingError(
                f"{origin}: column '{words.name}', row {row}: {text!r} is no number."
            )
    return numbers.fill_nan(None)
