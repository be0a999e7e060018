"""Bags as tables: MCAP files, and rosbag2's folders and files in SQLite (.db3), without ROS.

A row is a message of one topic of ``sensor_msgs/JointState``; of all other topics it has the newest
message that was logged by then. Columns are called after topic, joint and quantity, as in
``joint_states/hip.position``, numbers of ``std_msgs/Float64`` after their topic.
"""

import contextlib
import re
import sqlite3
import urllib.parse
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import polars as pl

from hopping_leg.errors import RecordingError
from hopping_leg.formats.ros_messages import (
    DEFINITIONS,
    FLOAT,
    JOINT_STATE,
    KEY,
    NAMES,
    QUANTITIES,
    STATES,
)
from hopping_leg.io import Tree, parse_json

_MCAP, _SQLITE = b"\x89MCAP0\r\n", b"SQLite format 3\0"
_ZSTD = b"\x28\xb5\x2f\xfd"
_LARGEST = 1 << 28  # record of an MCAP file, bytes
_LOGGED, _STAMP = "/logged", "/stamp"  # columns of times, ns; no topic is called so


class _Logged(NamedTuple):
    """A message of a bag."""

    topic: str
    kind: str
    time: int
    """When it was logged, ns."""
    content: bytes
    """CDR."""


def bag_files(path: Path) -> list[Path]:
    """Return the files of a bag in their order; none where a path is no bag.

    Raises:
        RecordingError: It is a bag whose files are compressed.
        OSError: It cannot be read.
    """
    if not path.is_dir():
        with path.open("rb") as file:
            return [path] if file.read(len(_SQLITE)).startswith((_MCAP, _SQLITE)) else []
    if packed := sorted([*path.glob("*.db3.zstd"), *path.glob("*.mcap.zstd")]):
        raise RecordingError(
            f"{path} holds compressed files; run `zstd -d {packed[0]}` first, for each of them."
        )
    found = [*path.glob("*.mcap"), *path.glob("*.db3")]
    return sorted(found, key=lambda file: [int(n) for n in re.findall(r"\d+", file.name)])


def read_bag(files: list[Path], origin: str) -> tuple[pl.DataFrame, Tree]:
    """Return the joints of a bag as a table; of one that was made of a trace also its header.

    The table has ``time_s``, counted from the whole second of the first row, and the columns of a
    trace where topics and joints are called as in ``ros_messages.COLUMNS``.

    Raises:
        RecordingError: The bag is damaged or holds no joint states.
    """
    header: Tree = {}
    try:
        logged: list[_Logged] = []
        for file in files:
            with file.open("rb") as stream:
                is_mcap = stream.read(len(_MCAP)) == _MCAP
            logged += _read_mcap(file) if is_mcap else _read_sqlite(file)
            header |= _read_header(file, origin) if is_mcap else {}
        states, others = _decode(logged)
        table = _join(states, others)
    except (ModuleNotFoundError, RecordingError):
        raise
    except Exception as error:  # readers raise many unrelated types where a file is damaged
        raise RecordingError(
            f"{origin} is no whole bag ({type(error).__name__}: {error}); `mcap recover` or"
            " `ros2 bag reindex` may mend it."
        ) from error
    if table is None:
        raise RecordingError(
            f"{origin} holds no message of {JOINT_STATE}; record the topic that has the joints."
        )
    return table.with_columns(
        pl.col(own).alias(c) for c, own in NAMES.items() if own in table
    ), header


def _read_mcap(file: Path) -> Iterator[_Logged]:
    from mcap.reader import SeekingReader

    with file.open("rb") as stream:
        reader = SeekingReader(stream, record_size_limit=_LARGEST)
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            if schema and schema.name in DEFINITIONS and channel.message_encoding == "cdr":
                yield _Logged(channel.topic, schema.name, message.log_time, message.data)


def _read_header(file: Path, origin: str) -> Tree:
    """Return the header of the trace that a file was made of, empty for others."""
    from mcap.reader import SeekingReader

    with file.open("rb") as stream:
        for entry in SeekingReader(stream, record_size_limit=_LARGEST).iter_metadata():
            if entry.name == KEY:
                text = entry.metadata["header"]
                header = parse_json(text, f"{origin}: its header", RecordingError)
                del header["schema"]
                return header
    return {}


def _read_sqlite(file: Path) -> Iterator[_Logged]:
    address = f"file:{urllib.parse.quote(str(file.resolve()))}?mode=ro&immutable=1"
    with contextlib.closing(sqlite3.connect(address, uri=True)) as base:
        topics = {key: of for key, *of in base.execute("SELECT id, name, type FROM topics")}
        for key, time, content in base.execute("SELECT topic_id, timestamp, data FROM messages"):
            topic, kind = topics[key]
            if kind in DEFINITIONS:
                yield _Logged(topic, kind, time, content)


Rows = dict[str, list[Tree]]
"""What was logged on each topic, a row a message."""


def _decode(logged: list[_Logged]) -> tuple[Rows, Rows]:
    """Return the rows of joint states and of numbers, by topic."""
    from mcap.records import Schema
    from mcap_ros2.decoder import DecoderFactory

    decoders: dict[str, Callable[[bytes], Any]] = {}
    for kind, text in DEFINITIONS.items():
        schema = Schema(id=1, name=kind, encoding="ros2msg", data=text.encode())
        decoders[kind] = DecoderFactory().decoder_for("cdr", schema) or bytes
    states: Rows = {}
    numbers: Rows = {}
    for topic, kind, time, content in logged:
        if content.startswith(_ZSTD):
            raise RecordingError(
                "Messages of this bag are compressed; `ros2 bag convert` it first."
            )
        name, message = topic.strip("/"), decoders[kind](content)
        if kind == FLOAT:
            numbers.setdefault(name, []).append({_LOGGED: time, name: message.data})
            continue
        stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
        row = {_LOGGED: time, _STAMP: stamp or time}
        for quantity in QUANTITIES:
            for joint, value in zip(message.name, getattr(message, quantity), strict=False):
                row[f"{name}/{joint}.{quantity}"] = value
        states.setdefault(name, []).append(row)
    return states, numbers


def _join(states: Rows, numbers: Rows) -> pl.DataFrame | None:
    """Return the measured joints with what was logged beside them, None where there are none."""
    if not states:
        return None
    measured = max(states, key=lambda topic: (topic.endswith(STATES), len(states[topic])))
    table = _table(states.pop(measured))
    for rows in [*states.values(), *numbers.values()]:
        table = table.join_asof(_table(rows).drop(_STAMP, strict=False), on=_LOGGED)
    stamp = pl.col(_STAMP) - pl.col(_STAMP).first() // 10**9 * 10**9
    return table.select((stamp / 1e9).alias("time_s"), pl.exclude(_LOGGED, _STAMP))


def _table(rows: list[Tree]) -> pl.DataFrame:
    return pl.DataFrame(rows, infer_schema_length=None).sort(_LOGGED, maintain_order=True)
