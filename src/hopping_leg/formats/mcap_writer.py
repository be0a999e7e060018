"""Traces as MCAP files that Foxglove, rerun and `ros2 bag` open: ROS 2 messages in CDR.

Times are those of the trace, from the start of the run; they are both the header's stamp and the
time of the log.
"""

import io
import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from mcap_ros2.writer import Writer

from hopping_leg.arrays import Array
from hopping_leg.errors import TraceError
from hopping_leg.formats.ros_messages import (
    COLUMNS,
    DEFINITIONS,
    FLOAT,
    JOINT_STATE,
    KEY,
    QUANTITIES,
)
from hopping_leg.trace import SCHEMA, Trace


def to_mcap(trace: Trace) -> bytes:
    """Return a trace as an MCAP file; what is missing in a column is NaN.

    Raises:
        TraceError: The trace has no time, or one before 1970.
    """
    stamps = np.rint(1e9 * trace.column("time_s"))
    if not (np.isfinite(stamps) & (stamps >= 0)).all():
        raise TraceError(
            "The trace's 'time_s' must be 0 or more in every row to be written as MCAP."
        )
    content = io.BytesIO()
    with Writer(content) as writer:
        header = json.dumps({"schema": SCHEMA, **trace.header}, sort_keys=True)
        writer.add_metadata(KEY, {"header": header})
        kinds = {name: writer.register_msgdef(name, text) for name, text in DEFINITIONS.items()}
        numbers = {name: trace.column(name) for name in trace.numbers}
        joints = {topic: _joints(numbers, of) for topic, of in COLUMNS.items()}
        used = {c for columns in COLUMNS.values() for triple in columns.values() for c in triple}
        others = [name for name in numbers if name not in used and name != "time_s"]
        for row, stamp in enumerate(map(int, stamps)):
            seconds, rest = divmod(stamp, 10**9)
            head = {"stamp": {"sec": seconds, "nanosec": rest}, "frame_id": ""}
            for topic, arrays in joints.items():
                if arrays["name"]:
                    values = {q: arrays[q][row].tolist() for q in QUANTITIES}
                    message = {"header": head, "name": arrays["name"], **values}
                    writer.write_message(f"/{topic}", kinds[JOINT_STATE], message, stamp)
            for name in others:
                message = {"data": numbers[name][row]}
                writer.write_message(f"/{name}", kinds[FLOAT], message, stamp)
    return content.getvalue()


def _joints(
    numbers: dict[str, Array], columns: Mapping[str, tuple[str, str, str]]
) -> dict[str, Any]:
    """Return the joints that have any value, and their arrays, (rows, joints) or (rows, 0)."""
    have = [
        joint
        for joint, triple in columns.items()
        if any(c in numbers and np.isfinite(numbers[c]).any() for c in triple)
    ]
    rows = len(numbers["time_s"])
    found: dict[str, Any] = {"name": have}
    for index, quantity in enumerate(QUANTITIES):
        wanted = [numbers.get(columns[joint][index], np.full(rows, np.nan)) for joint in have]
        stacked = np.stack(wanted, axis=1) if have else np.empty((rows, 0))
        found[quantity] = stacked if np.isfinite(stacked).any() else np.empty((rows, 0))
    return found
