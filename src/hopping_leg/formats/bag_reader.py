"""Bags as tables: MCAP files, and rosbag2's folders and files in SQLite (.db3), without ROS.

A row is a message of one topic of ``sensor_msgs/JointState``; of all other topics it has the newest
message that was logged by then. Columns are called after topic, joint and quantity, as in
``joint_states/hip.position``, numbers of ``std_msgs/Float64`` after their topic.
"""

from pathlib import Path
from typing import Any

import polars as pl

from hopping_leg.errors import RecordingError
from hopping_leg.formats.ros_messages import FLOAT, JOINT_STATE, KEY, NAMES, QUANTITIES, STATES
from hopping_leg.io import Tree, parse_json

_MCAP, _SQLITE = b"\x89MCAP0\r\n", b"SQLite format 3\0"
_LOGGED, _STAMP = "/logged", "/stamp"  # columns of times, ns; no topic is called so

Rows = dict[str, list[Tree]]
"""What was logged on each topic, a row a message."""


def bag_files(path: Path) -> list[Path]:
    """Return the files of a bag; none where a path is no bag.

    Raises:
        OSError: It cannot be read.
    """
    if path.is_dir():
        return sorted(file for file in path.iterdir() if {".mcap", ".db3"} & {*file.suffixes})
    with path.open("rb") as file:
        return [path] if file.read(len(_SQLITE)).startswith((_MCAP, _SQLITE)) else []


def read_bag(path: Path, origin: str) -> tuple[pl.DataFrame, Tree]:
    """Return the joints of a bag as a table; of one that was made of a trace also its header.

    The table has ``time_s``, counted from the whole second of the first row, and the columns of a
    trace where topics and joints are called as in ``ros_messages.COLUMNS``.

    Raises:
        RecordingError: The bag is damaged or holds no joint states.
    """
    try:
        states, numbers = _messages(path)
        header = _header(path, origin) if path.suffix == ".mcap" else {}
        table = _join(states, numbers) if states else None
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
    named = [pl.col(own).alias(name) for name, own in NAMES.items() if own in table]
    return table.with_columns(named), header


def _messages(path: Path) -> tuple[Rows, Rows]:
    """Return the rows of joint states and of numbers, by topic."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    states: Rows = {}
    numbers: Rows = {}
    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as bag:
        wanted = [c for c in bag.connections if c.msgtype in (JOINT_STATE, FLOAT)]
        for connection, time, raw in bag.messages(wanted) if wanted else ():
            name = connection.topic.strip("/")
            message: Any = bag.deserialize(raw, connection.msgtype)
            if connection.msgtype == FLOAT:
                numbers.setdefault(name, []).append({_LOGGED: time, name: message.data})
                continue
            stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
            row = {_LOGGED: time, _STAMP: stamp or time}
            for quantity in QUANTITIES:
                for joint, value in zip(message.name, getattr(message, quantity), strict=False):
                    row[f"{name}/{joint}.{quantity}"] = float(value)
            states.setdefault(name, []).append(row)
    return states, numbers


def _header(file: Path, origin: str) -> Tree:
    """Return the header of the trace that a file was made of, empty for others."""
    from mcap.reader import SeekingReader

    with file.open("rb") as stream:
        for entry in SeekingReader(stream).iter_metadata():
            if entry.name == KEY:
                text = entry.metadata["header"]
                header = parse_json(text, f"{origin}: its header", RecordingError)
                del header["schema"]
                return header
    return {}


def _join(states: Rows, numbers: Rows) -> pl.DataFrame:
    """Return the measured joints with what was logged beside them."""
    measured = max(states, key=lambda topic: (topic.endswith(STATES), len(states[topic])))
    table = _table(states.pop(measured))
    for rows in [*states.values(), *numbers.values()]:
        table = table.join_asof(_table(rows).drop(_STAMP, strict=False), on=_LOGGED)
    stamp = pl.col(_STAMP) - pl.col(_STAMP).first() // 10**9 * 10**9
    return table.select((stamp / 1e9).alias("time_s"), pl.exclude(_LOGGED, _STAMP))


def _table(rows: list[Tree]) -> pl.DataFrame:
    return pl.DataFrame(rows, infer_schema_length=None).sort(_LOGGED, maintain_order=True)
