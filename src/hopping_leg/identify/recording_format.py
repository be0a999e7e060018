"""What a recording holds: its columns, and the metadata that its rows do not say."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
import polars as pl

from hopping_leg.arrays import Array
from hopping_leg.errors import RecordingError
from hopping_leg.robot import Boom

PAIRS = {
    "position": ("hip_position_rad", "knee_position_rad"),
    "velocity": ("hip_velocity_rad_s", "knee_velocity_rad_s"),
    "torque": ("hip_torque_nm", "knee_torque_nm"),
    "position_command": ("hip_position_command_rad", "knee_position_command_rad"),
    "velocity_command": ("hip_velocity_command_rad_s", "knee_velocity_command_rad_s"),
    "torque_command": ("hip_command_nm", "knee_command_nm"),
    "stiffness": ("hip_stiffness_nm_rad", "knee_stiffness_nm_rad"),
    "damping": ("hip_damping_nm_s_rad", "knee_damping_nm_s_rad"),
    "position_estimate": ("hip_position_estimate_rad", "knee_position_estimate_rad"),
    "velocity_estimate": ("hip_velocity_estimate_rad_s", "knee_velocity_estimate_rad_s"),
}
"""Quantities that hip and knee both have, each with its two columns.

The first three are measured. Commanded position and velocity are targets of the on-board PD, the
commanded torque is its feed-forward, or all there is; gains stand where they change from row to
row. Estimates are guesses where nothing was measured and never scored.
"""

COLUMNS: dict[str, type[pl.DataType]] = {
    "time_s": pl.Float64,
    "row": pl.Int64,
    "exact_time": pl.Boolean,
    "height_m": pl.Float64,
    "base_rise_m": pl.Float64,
    "contact": pl.Boolean,
    "phase": pl.String,
} | {column: pl.Float64 for columns in PAIRS.values() for column in columns}
"""Every column of a recording; time and one position are required, a fit needs both.

``row`` is that of the source file, the first below the header being 0; ``exact_time`` is false
where the time stamp is a guess; ``height_m`` is the hip axis above the ground, ``base_rise_m`` the
base above an unknown zero, ``contact`` the foot's, ``phase`` what the rig's controller did.
"""

MEASURED = PAIRS["position"] + PAIRS["velocity"] + PAIRS["torque"]  # Columns that sensors filled


def float_column(table: pl.DataFrame, column: str) -> Array:
    """Return a table's column as floats, (rows,), NaN where it is null or missing."""
    if column not in table.columns:
        return np.full(table.height, np.nan)
    return np.array(table[column].cast(pl.Float64).to_numpy())


def cast(
    table: pl.DataFrame, kinds: Mapping[str, type[pl.DataType]], origin: str | Path
) -> pl.DataFrame:
    """Return the columns of these kinds, or raise RecordingError for one that holds others."""
    series = []
    for name in (name for name in kinds if name in table):
        try:
            series.append(table[name].cast(kinds[name]))
        except pl.exceptions.PolarsError as error:
            said = str(error).partition("\n")[0].rpartition("values: ")[2]
            raise RecordingError(
                f"{origin}: column '{name}' must hold numbers, not {said}; write them with a point,"
                " leave a field empty where there is none, delete a row of units."
            ) from error
    return pl.DataFrame(series)


def sidecar_path(path: Path) -> Path:
    """Return where a table's sidecar would be."""
    name = path.name.removesuffix(".gz")
    return path.with_name(f"{Path(name).stem}.toml")


Rig = Literal["fixed-base", "rail", "boom"]
Sample = Literal["before-command", "after-command"]
Onboard = Literal["torque", "zoh", "continuous"]
Pair = tuple[float, float]


@dataclass(frozen=True)
class RecordingMetadata:
    """How a recording was made; pairs are (hip, knee). Impossible values raise RecordingError."""

    rig: Rig
    """Where the base is: clamped, on the vertical rail, or on a boom."""
    rate_hz: float
    """Nominal rate of commands and rows."""
    robot: str
    """Robot file that the recording belongs to: a shipped name or a path."""
    source: str
    """Who recorded it, where and when."""
    boom: Boom = field(default_factory=Boom)
    """The boom, where the base is on one: plain numbers in the units of a robot file."""
    sample: Sample = "before-command"
    """Whether row n holds the state before or after command n acted."""
    onboard: Onboard = "torque"
    """What the motors close by themselves: nothing (``torque``), a PD that holds each command
    for a period and computes its torque once per row (``zoh``), or one at many kHz
    (``continuous``)."""
    stiffness: Pair | None = None
    damping: Pair | None = None
    integral: Pair | None = None
    """Gains of the on-board PID, N m/rad, N m s/rad, N m/(rad s) at the joint; none if unknown."""
    gains_exact: bool = True
    """False where the gains are estimates that a fit should refine."""
    zeroed: bool = False
    """Whether the encoders were zeroed with the leg hanging at rest, where friction may hold it
    some degrees off; a fit then finds each recording's zeros from its first second."""
    torque_limit: Pair | None = None
    """Largest torque the rig let through, N m at the joint; none takes the robot file's."""
    startup_rows: int = 0
    """First rows of the file whose commands were not applied; the loader leaves them out."""

    def __post_init__(self) -> None:
        if not 0 < self.rate_hz < np.inf:
            raise RecordingError(f"'rate_hz' is {self.rate_hz} but must be positive and finite.")
        if (self.rig == "boom") != (self.boom.radius > 0):
            raise RecordingError(
                f"The rig is '{self.rig}' but the boom's radius is {self.boom.radius:g} m; describe"
                " a boom, and only a boom, in [boom]."
            )
        if self.startup_rows < 0:
            raise RecordingError(f"'startup_rows' is {self.startup_rows} but must be 0 or more.")
        for name in ("stiffness", "damping", "integral", "torque_limit"):
            pair = getattr(self, name)
            if pair is not None and not all(0 <= value < np.inf for value in pair):
                raise RecordingError(f"'{name}' is {pair} but must hold zero or more, finite.")

    @property
    def period(self) -> float:
        """Nominal time from row to row, s."""
        return 1 / self.rate_hz
