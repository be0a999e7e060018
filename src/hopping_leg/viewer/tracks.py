"""What is shown of one leg, whatever it comes from: rows over time.

A live simulation appends rows as it goes, a replay has them all, a run on the real leg grows from
outside; scene and plots know nothing but tracks.
"""

import numpy as np
import polars as pl

from hopping_leg import hop_detection
from hopping_leg.arrays import Array
from hopping_leg.robot import Robot, kinematics
from hopping_leg.trace import Trace

FIELDS = (
    "command_m",
    "height_m",
    "height_rate_m_s",
    "hip_position_rad",
    "knee_position_rad",
    "hip_torque_nm",
    "knee_torque_nm",
    "foot_clearance_m",
    "phase",
)
"""What a row holds beside its time; names are those of traces. ``phase`` is the controller's."""

_ANGLES = ("hip_position_rad", "knee_position_rad")
_ESTIMATE = "estimated_height_m"
_APEX_SECONDS = 3.0


class Track:
    """One leg's rows, in order of time.

    Args:
        name: Of who controls the leg.
        robot: The leg.
        depth: Rows that are kept; older ones are forgotten. 0 keeps all.

    Attributes:
        note: What the reader should know of where the rows come from.
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
        values: Array = self._rows[1 + FIELDS.index(name)]
        return values

    def extend(self, time: Array, values: Array) -> None:
        """Add rows that are later than all others: times (rows,) and values (fields, rows)."""
        grown = np.concatenate([self._rows, np.vstack([time, values])], axis=1)
        self._rows = grown[:, -self._depth :]

    def extend_by_trace(self, trace: Trace) -> None:
        """Add the rows of a trace; ``note`` says what height is shown where none was measured.

        Hardware does not measure the base height. The controller's own estimate stands in where it
        recorded one; else the leg is shown standing, at the height its joints give a foot on the
        ground, which is right in stance and too low in flight. The clearance stays unknown. Joint
        angles that are missing are those before them.
        """
        known, unknown = trace.table.columns, np.full(len(trace.table), np.nan)
        columns = {name: trace.column(name) if name in known else unknown for name in FIELDS}
        for name in _ANGLES:
            before = self.field(name)[-1:] if len(self) else [np.nan]
            angle = pl.Series(np.append(before, columns[name])).fill_nan(None)
            angle = angle.fill_null(strategy="forward").fill_null(strategy="backward").fill_null(0)
            columns[name] = angle.to_numpy()[1:]
        if not np.isfinite(columns["height_m"]).any():
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
        row = int(np.searchsorted(self.time, time + 1e-9, side="right")) - 1
        return float(self.field(name)[row]) if row >= 0 else float("nan")

    def sample(self, grid: Array) -> dict[str, Array]:
        """Return every field at rising times, NaN where there is no row, (times,) each."""
        time = self.time
        if not len(time):
            return {name: np.full(len(grid), np.nan) for name in FIELDS}
        near = np.clip(np.searchsorted(time, grid + 1e-9, side="right") - 1, 0, None)
        outside = (grid < time[0] - 1e-9) | (grid > time[-1] + 1e-9)
        taken = self._rows[1:, near]
        taken[:, outside] = np.nan
        return dict(zip(FIELDS, taken, strict=True))

    def apexes(self, until: float, seconds: float) -> Array:
        """Return the heights of the apexes in the ``seconds`` up to a time, m, (hops,)."""
        first, last = np.searchsorted(self.time, [until - seconds, until + 1e-9])
        part = slice(int(first), int(last))
        names = ("height_m", "height_rate_m_s", "foot_clearance_m")
        height, rate, clearance = (self.field(name)[part] for name in names)
        if len(height) < 2:
            return np.zeros(0)
        return hop_detection.find_hops(height, rate, clearance).apex

    def last_apex(self, until: float) -> float:
        """Return the height of the last apex up to a time, m, NaN if it is long ago."""
        apexes = self.apexes(until, _APEX_SECONDS)
        return float(apexes[-1]) if len(apexes) else float("nan")


def in_flight(clearance: Array) -> Array:
    """Return 1 where the foot is in the air, 0 where it is not, NaN where that is unknown."""
    return np.where(
        np.isfinite(clearance),
        (clearance >= hop_detection.FLIGHT_CLEARANCE).astype(np.float64),
        np.nan,
    )
