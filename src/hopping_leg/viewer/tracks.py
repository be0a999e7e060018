"""What is shown: one leg's rows over time, from a live simulation or stored traces.

A live simulation appends rows as it goes, a replay has them all; scene and curves know nothing but
tracks.
"""

from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from hopping_leg import errors, hop_detection
from hopping_leg.arrays import Array, IntArray
from hopping_leg.flight_recording import load_trace
from hopping_leg.robot import Robot, kinematics, load_robot
from hopping_leg.sim import CONTROL_RATE
from hopping_leg.trace import Trace

MOST = 2  # Legs side by side

FIELDS = (
    "command_m",
    "height_m",
    "height_rate_m_s",
    "hip_position_rad",
    "knee_position_rad",
    "hip_torque_nm",
    "knee_torque_nm",
    "foot_clearance_m",
)
"""What a row holds beside its time; names are those of traces."""

KEPT = round(10 * CONTROL_RATE)  # Rows of the past that are kept of what goes on

_ANGLES = ("hip_position_rad", "knee_position_rad")
_ESTIMATE = "estimated_height_m"


class Track:
    """One leg's rows, in order of time; ``name`` is of who controls the leg.

    Older rows than ``depth`` are forgotten; 0 keeps all. ``note`` is what the reader should know of
    where the rows come from.
    """

    def __init__(self, name: str, robot: Robot, *, depth: int = 0) -> None:
        self.name, self.robot, self.note = name, robot, ""
        self._depth = depth
        self._rows = np.empty((1 + len(FIELDS), 0))

    def __len__(self) -> int:
        return self._rows.shape[1]

    @property
    def time(self) -> Array:
        """Time of each row, s, (rows,)."""
        time: Array = self._rows[0]
        return time

    def field(self, name: str) -> Array:
        """Return one of ``FIELDS``, (rows,)."""
        column: Array = self._rows[1 + FIELDS.index(name)]
        return column

    def extend(self, time: Array, values: Array) -> None:
        """Add rows that are later than all others: times (rows,) and values (fields, rows)."""
        grown = np.concatenate([self._rows, np.vstack([time, values])], axis=1)
        self._rows = grown[:, -self._depth :]

    def extend_by_trace(self, trace: Trace) -> None:
        """Add the rows of a trace; ``note`` says what height is shown where none was measured.

        There the controller's own estimate stands in where it recorded one; else the leg is shown
        standing, at the height its joints give a foot on the ground, which is right in stance and
        too low in flight. The clearance stays unknown. Joint angles and measured heights that are
        missing are those before them.
        """
        known, unknown = trace.table.columns, np.full(len(trace.table), np.nan)
        columns = {name: trace.column(name) if name in known else unknown for name in FIELDS}
        measured = np.isfinite(columns["height_m"]).any()
        for name in (*_ANGLES, "height_m") if measured else _ANGLES:
            angle = pl.Series(columns[name]).fill_nan(None).fill_null(strategy="forward")
            columns[name] = angle.fill_null(strategy="backward").fill_null(0).to_numpy()
        if not measured:
            q = np.stack([columns[name] for name in _ANGLES], axis=-1)
            columns["height_m"] = kinematics.stance_height(self.robot, q)
            self.note = "The height was not measured: the leg is shown standing."
            if _ESTIMATE in known:
                estimate = trace.column(_ESTIMATE)
                columns["height_m"] = np.where(np.isfinite(estimate), estimate, columns["height_m"])
                self.note = "The height was not measured: it is the controller's estimate."
        self.extend(trace.column("time_s"), np.stack(list(columns.values())))

    def moment(self, time: float) -> tuple[float, Array]:
        """Return base height, m, and joint angles, rad, (2,), at a time, also between rows."""
        height, *q = (np.interp(time, self.time, self.field(n)) for n in ("height_m", *_ANGLES))
        return float(height), np.array(q)

    def latest(self, name: str, time: float) -> float:
        """Return a field of the last row up to a time, NaN if there is none."""
        row = int(self._rows_until(np.array(time)))
        return float(self.field(name)[row]) if row >= 0 else float("nan")

    def sample(self, grid: Array) -> dict[str, Array]:
        """Return every field at rising times, NaN where there is no row, (times,) each."""
        late = grid > self.time.max(initial=-np.inf) + 1e-9
        rows = np.where(late, -1, self._rows_until(grid))
        shown = self._rows[1:, rows] if len(self) else np.empty((len(FIELDS), len(grid)))
        shown[:, rows < 0] = np.nan
        return dict(zip(FIELDS, shown, strict=True))

    def _rows_until(self, times: Array) -> IntArray:
        """Return the number of the last row up to each time, -1 if there is none."""
        return np.searchsorted(self.time, times + 1e-9, side="right") - 1

    def last_apex(self, until: float) -> float:
        """Return the height of the last apex up to a time, m, NaN if it is 3 s ago or more."""
        first, last = np.searchsorted(self.time, [until - 3.0, until + 1e-9])
        if last - first < 2:
            return float("nan")
        part = [self.field(name)[first:last] for name in hop_detection.COLUMNS]
        return float(np.append(np.nan, hop_detection.find_hops(*part).apex)[-1])


class ReplaySource:
    """One or two traces, or flight recordings, side by side; both begin at zero.

    The robot, a name or file, is the one that each trace names unless it is given. UsageError says
    that there are too many traces, TraceError that one cannot be read or holds no tick, RobotError
    that its robot is no shipped one and none was given.
    """

    def __init__(self, paths: tuple[Path, ...], robot: str | None = None) -> None:
        if not 1 <= len(paths) <= MOST:
            raise errors.UsageError(f"Give one, or two traces side by side, not {len(paths)}.")
        self.notices: list[str] = []
        self.now = 0.0
        self.tracks = [self._load(path, robot) for path in paths]
        for track in self.tracks:
            track.time[:] -= track.time[0]
        self.length = max(float(track.time[-1]) for track in self.tracks)

    def advance(self, seconds: float) -> None:
        """Let time pass; the end is followed by the beginning."""
        self.now += seconds
        if self.now > self.length:
            self.now = 0.0

    def seek(self, time: float) -> None:
        """Show another time, s."""
        self.now = min(max(time, 0.0), self.length)

    def _load(self, path: Path, robot: str | None) -> Track:
        stored = load_trace(path)
        stored.require_ticks(path)
        leg = _load_leg(robot, stored.header, path)
        if not leg.has_digest(stored.header.get("robot_digest", leg.digest)):
            self.notices.append(
                f"{path.name} was recorded from other parameters than those of {leg.name}."
            )
        track = Track(str(stored.header.get("controller", path.stem)), leg)
        track.extend_by_trace(stored)
        return track


def _load_leg(robot: str | None, header: dict[str, Any], path: Path) -> Robot:
    """Return the robot asked for, else the one that a recording names."""
    name = str(header.get("robot", ""))
    try:
        leg = load_robot(robot or name)
    except errors.RobotError as error:
        if robot:
            raise
        raise errors.RobotError(
            f"{path} is of '{name}', which is no shipped robot; give its file with --robot."
        ) from error
    leg.require_leg()
    return leg
