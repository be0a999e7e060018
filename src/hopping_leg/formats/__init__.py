"""ROS 2 bags and MCAP files: traces are written for other tools, what those record is read.

``docs/other-tools.md`` says which topic holds what. Times are those of the trace, from the start
of the run, as header's stamp and as time of the log. Of a bag, an MCAP file or rosbag2's folders
and files in SQLite (.db3), columns are called after topic, joint and quantity, as in
``joint_states/hip.position``, a ``std_msgs/Float64`` after its topic, an array's as ``topic[0]``.
"""

import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from hopping_leg.arrays import Array
from hopping_leg.errors import RecordingError, TraceError
from hopping_leg.io import Tree
from hopping_leg.trace import SCHEMA, Trace

JOINT_STATE = "sensor_msgs/msg/JointState"
FLOAT, FLOATS = "std_msgs/msg/Float64", "std_msgs/msg/Float64MultiArray"

STATES = "joint_states"
COMMANDS = "joint_commands"
QUANTITIES = ("position", "velocity", "effort")
"""Arrays of a ``JointState``."""

COLUMNS = {
    STATES: {
        "rail": ("height_m", "height_rate_m_s", ""),
        "hip": ("hip_position_rad", "hip_velocity_rad_s", "hip_torque_nm"),
        "knee": ("knee_position_rad", "knee_velocity_rad_s", "knee_torque_nm"),
    },
    COMMANDS: {
        joint: (
            f"{joint}_position_command_rad",
            f"{joint}_velocity_command_rad_s",
            f"{joint}_command_nm",
        )
        for joint in ("hip", "knee")
    },
}
"""Columns of a trace or recording by topic and joint, in the order of ``QUANTITIES``."""

NAMES = {
    column: f"{topic}/{joint}.{quantity}"
    for topic, joints in COLUMNS.items()
    for joint, columns in joints.items()
    for quantity, column in zip(QUANTITIES, columns, strict=True)
    if column
}
"""What a bag's own columns are called for each of a recording's."""

_MCAP, _SQLITE = b"\x89MCAP0\r\n", b"SQLite format 3\0"
_LOGGED, _STAMP = "/logged", "/stamp"  # columns of times, ns; no topic is called so

Rows = dict[str, list[Tree]]
"""What was logged on each topic, a row a message."""


def to_mcap(trace: Trace) -> bytes:
    """Return a trace, gaps as NaN, as MCAP; TraceError where it has no time, or one before 1970."""
    from mcap_ros2.writer import Writer
    from rosbags.typesys import Stores, get_typestore

    definitions = get_typestore(Stores.ROS2_HUMBLE)
    stamps = np.rint(1e9 * trace.column("time_s"))
    if not (np.isfinite(stamps) & (stamps >= 0)).all():
        raise TraceError(
            "The trace's 'time_s' must be 0 or more in every row to be written as MCAP."
        )
    content = io.BytesIO()
    with Writer(content) as writer:
        header = json.dumps({"schema": SCHEMA, **trace.header}, sort_keys=True)
        writer.add_metadata("hopping_leg", {"header": header})
        kinds = {
            name: writer.register_msgdef(name, definitions.generate_msgdef(name, ros_version=2)[0])
            for name in (JOINT_STATE, FLOAT)
        }
        kinds_of = trace.table.schema.items()
        kept = (name for name, kind in kinds_of if kind.is_numeric() or kind == pl.Boolean)
        numbers = {name: trace.column(name) for name in kept}
        arrays = {topic: _arrays(numbers, joints) for topic, joints in COLUMNS.items()}
        others = [name for name in numbers if name not in NAMES and name != "time_s"]
        for row, stamp in enumerate(map(int, stamps)):
            seconds, rest = divmod(stamp, 10**9)
            head = {"stamp": {"sec": seconds, "nanosec": rest}, "frame_id": ""}
            for topic, joints in COLUMNS.items():
                if values := {name: array[row].tolist() for name, array in arrays[topic].items()}:
                    message = {"header": head, "name": [*joints], **values}
                    writer.write_message(f"/{topic}", kinds[JOINT_STATE], message, stamp)
            for name in others:
                message = {"data": numbers[name][row]}
                writer.write_message(f"/{name}", kinds[FLOAT], message, stamp)
    return content.getvalue()


def _arrays(
    numbers: dict[str, Array], joints: Mapping[str, tuple[str, str, str]]
) -> dict[str, Array]:
    """Return each quantity that any joint has, (rows, joints), NaN where a joint has none."""
    unknown = np.full(len(numbers["time_s"]), np.nan)
    return {
        quantity: np.stack([numbers.get(column, unknown) for column in columns], axis=1)
        for quantity, columns in zip(QUANTITIES, zip(*joints.values(), strict=True), strict=True)
        if numbers.keys() & {*columns}
    }


def bag_files(path: Path) -> list[Path]:
    """Return the files of a bag, none of what is no bag; OSError where it cannot be read."""
    if path.is_dir():
        return sorted(file for file in path.iterdir() if {".mcap", ".db3"} & {*file.suffixes})
    with path.open("rb") as file:
        return [path] if file.read(len(_SQLITE)).startswith((_MCAP, _SQLITE)) else []


def read_bag(path: Path, origin: str) -> pl.DataFrame:
    """Return the joints of a bag as a table.

    The table has ``time_s``, counted from the whole second of the first row, and the columns of a
    trace where topics and joints are called as in ``COLUMNS``. RecordingError says that the bag is
    damaged or holds no joint states.
    """
    try:
        states, numbers = _messages(path)
        table = None
        if states:  # the measured joints with what was logged beside them
            measured = max(states, key=lambda topic: (topic.endswith(STATES), len(states[topic])))
            table = _table(states.pop(measured))
            for rows in [*states.values(), *numbers.values()]:
                table = table.join_asof(_table(rows).drop(_STAMP, strict=False), on=_LOGGED)
            stamp = pl.col(_STAMP) - pl.col(_STAMP).first() // 10**9 * 10**9
            table = table.select((stamp / 1e9).alias("time_s"), pl.exclude(_LOGGED, _STAMP))
    except ModuleNotFoundError:
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
    return table.with_columns(named)


def _messages(path: Path) -> tuple[Rows, Rows]:
    """Return the rows of joint states and of numbers, by topic."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    states: Rows = {}
    numbers: Rows = {}
    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as bag:
        wanted = [c for c in bag.connections if c.msgtype in (JOINT_STATE, FLOAT, FLOATS)]
        for connection, time, raw in bag.messages(wanted) if wanted else ():
            name = connection.topic.strip("/")
            message: Any = bag.deserialize(raw, connection.msgtype)
            if connection.msgtype != JOINT_STATE:
                values = {name: message.data}
                if connection.msgtype == FLOATS:
                    values = {f"{name}[{i}]": float(value) for i, value in enumerate(message.data)}
                numbers.setdefault(name, []).append({_LOGGED: time, **values})
                continue
            stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
            row = {_LOGGED: time, _STAMP: stamp or time}
            for quantity in QUANTITIES:
                for joint, value in zip(message.name, getattr(message, quantity), strict=False):
                    if value == value:  # a joint without the quantity has NaN
                        row[f"{name}/{joint}.{quantity}"] = float(value)
            states.setdefault(name, []).append(row)
    return states, numbers


def _table(rows: list[Tree]) -> pl.DataFrame:
    return pl.DataFrame(rows, infer_schema_length=None).sort(_LOGGED, maintain_order=True)
