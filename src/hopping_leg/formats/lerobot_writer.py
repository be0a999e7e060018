"""Traces as a LeRobot dataset, format v3.0: an episode a trace, a frame a control tick.

Layout: https://huggingface.co/docs/lerobot/lerobot-dataset-v3. All episodes stand in one file;
there are no videos.
"""

import io
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from pyarrow import parquet

from hopping_leg.arrays import Array
from hopping_leg.errors import TraceError
from hopping_leg.io import write_atomically, write_json
from hopping_leg.trace import Trace

STATE = (
    *("hip_position_rad", "knee_position_rad", "hip_velocity_rad_s", "knee_velocity_rad_s"),
    "command_m",
)
ENVIRONMENT = ("height_m", "height_rate_m_s", "foot_clearance_m")
ACTION = ("hip_command_nm", "knee_command_nm")
FEATURES = {
    "observation.state": STATE,
    "observation.environment_state": ENVIRONMENT,
    "action": ACTION,
}
"""Columns of a trace in each feature; the environment's state only where all traces know it."""

_INDICES = ("frame_index", "episode_index", "index", "task_index")
_QUANTILES = (1, 10, 50, 90, 99)
_FILE = "chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
_FIRST = _FILE.format(chunk_index=0, file_index=0)
_INDEX = "task"


def write_lerobot(traces: Sequence[Trace], folder: Path) -> None:
    """Write a dataset into a folder that does not exist yet.

    A value that is missing, as in a tick without a reply of the drive, is that of the tick before.

    Raises:
        TraceError: The folder exists, traces differ in robot or rate, lack a column, or have no
            value in one of them.
    """
    if folder.exists():
        raise TraceError(f"{folder} exists already; give another folder for the dataset.")
    robots = sorted({str(trace.header.get("robot")) for trace in traces})
    rates = sorted({_rate(trace) for trace in traces})
    if len(robots) > 1 or len(rates) > 1:
        raise TraceError(
            "A dataset is of one robot at one rate, but these traces are of"
            f" {', '.join(robots)} at {', '.join(map(str, rates))} Hz; export them one by one."
        )
    known = all(
        c in t.numbers and np.isfinite(t.column(c)).all() for t in traces for c in ENVIRONMENT
    )
    features = {n: c for n, c in FEATURES.items() if known or c is not ENVIRONMENT}
    tasks = list(dict.fromkeys(map(_task, traces)))
    frames, episodes = _tabulate(traces, features, tasks, rates[0])
    info = _info(features, robots[0], rates[0], len(frames), len(traces), len(tasks))
    write_json(folder / "meta/info.json", info)
    write_json(folder / "meta/stats.json", _statistics(frames))
    index = {"name": _INDEX, "field_name": _INDEX, "metadata": None}
    index |= {"pandas_type": "unicode", "numpy_type": "object"}
    pandas = {"index_columns": [_INDEX], "column_indexes": [], "columns": [index]}
    table = pl.DataFrame({"task_index": range(len(tasks)), _INDEX: tasks})
    _write(folder / "meta/tasks.parquet", table, {"pandas": json.dumps(pandas)})
    _write(folder / "meta/episodes" / _FIRST, episodes)
    _write(folder / "data" / _FIRST, frames)


def _rate(trace: Trace) -> int:
    """Return the control rate, Hz, a whole number as LeRobot has it."""
    steps = np.diff(trace.column("time_s"))
    if not len(steps) or not 0 < (period := float(np.median(steps))) <= 1:
        raise TraceError(
            "A trace's 'time_s' must rise, with a row a second or more, for a dataset."
        )
    return round(1 / period)


def _task(trace: Trace) -> str:
    low, high = (f"{f(trace.column('command_m')):.3g}" for f in (np.min, np.max))
    return f"hop to {low} m" if low == high else f"hop to heights from {low} to {high} m"


def _tabulate(
    traces: Sequence[Trace], features: dict[str, tuple[str, ...]], tasks: list[str], rate: int
) -> tuple[pl.DataFrame, pl.DataFrame]:
    """Return the frames of all episodes, and a row for each episode."""
    parts: list[pl.DataFrame] = []
    rows: list[dict[str, Any]] = []
    begin = 0
    for number, trace in enumerate(traces):
        count, task = trace.table.height, _task(trace)
        ticks = np.arange(count)
        numbers = (ticks, np.full(count, number), begin + ticks, np.full(count, tasks.index(task)))
        part = pl.DataFrame(
            {name: _filled(trace, columns) for name, columns in features.items()}
            | {"timestamp": (ticks / rate).astype(np.float32)}
            | dict(zip(_INDICES, numbers, strict=True)),
            schema_overrides={n: pl.Array(pl.Float32, len(c)) for n, c in features.items()},
        )
        statistics = _statistics(part)
        rows.append(
            {"episode_index": number, "tasks": [task], "length": count}
            | {"data/chunk_index": 0, "data/file_index": 0}
            | {"dataset_from_index": begin, "dataset_to_index": begin + count}
            | {f"stats/{n}/{kind}": v for n, of in statistics.items() for kind, v in of.items()}
            | {"meta/episodes/chunk_index": 0, "meta/episodes/file_index": 0}
        )
        parts.append(part)
        begin += count
    return pl.concat(parts), pl.DataFrame(rows)


def _filled(trace: Trace, columns: tuple[str, ...]) -> Array:
    """Return columns side by side, (ticks, columns), what is missing filled from before."""
    for name in columns:
        if not np.isfinite(trace.column(name)).any():
            raise TraceError(f"The trace has no value in '{name}', which a dataset needs.")
    table = trace.table.select(pl.col(c).cast(pl.Float64).fill_nan(None) for c in columns)
    return table.fill_null(strategy="forward").fill_null(strategy="backward").to_numpy()


def _statistics(frames: pl.DataFrame) -> dict[str, dict[str, list[float]]]:
    """Return what normalisation needs of every feature, by its entries."""
    found = {}
    for name in frames.columns:
        values = frames[name].to_numpy().astype(np.float64).reshape(len(frames), -1)
        of = {"min": values.min(axis=0), "max": values.max(axis=0), "mean": values.mean(axis=0)}
        of |= {"std": values.std(axis=0), "count": np.array([len(values)])}
        of |= {f"q{p:02d}": np.percentile(values, p, axis=0) for p in _QUANTILES}
        found[name] = {kind: entries.tolist() for kind, entries in of.items()}
    return found


def _info(
    features: dict[str, tuple[str, ...]],
    robot: str,
    rate: int,
    frames: int,
    episodes: int,
    tasks: int,
) -> dict[str, Any]:
    """Return what ``meta/info.json`` holds."""
    described: dict[str, Any] = {
        name: {"dtype": "float32", "shape": [len(columns)], "names": list(columns)}
        for name, columns in features.items()
    }
    for name in ("timestamp", *_INDICES):
        kind = "float32" if name == "timestamp" else "int64"
        described[name] = {"dtype": kind, "shape": [1], "names": None}
    return {
        "codebase_version": "v3.0",
        "robot_type": robot,
        "total_episodes": episodes,
        "total_frames": frames,
        "total_tasks": tasks,
        "chunks_size": 1000,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200,
        "fps": rate,
        "splits": {"train": f"0:{episodes}"},
        "data_path": f"data/{_FILE}",
        "video_path": None,
        "features": described,
    }


def _write(path: Path, table: pl.DataFrame, metadata: dict[str, str] | None = None) -> None:
    content = io.BytesIO()
    parquet.write_table(table.to_arrow().replace_schema_metadata(metadata), content)
    write_atomically(path, content.getvalue())
