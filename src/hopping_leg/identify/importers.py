"""Recordings of other loggers, recognised by their columns; a rig's format is a file in rigs/."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path

import numpy as np
import polars as pl

from hopping_leg.errors import RecordingError
from hopping_leg.identify.recording_format import PAIRS, RecordingMetadata
from hopping_leg.io import parse_toml, read_dataclass

BOOM_RADIUS = 1.146
"""Base rise per sine of boom pitch, m."""


@dataclass(frozen=True)
class LogFormat:
    """Tables of one rig's logger."""

    recognised_by: tuple[str, ...]
    """Columns that tell the rig."""
    metadata: RecordingMetadata
    columns: dict[str, str]
    """The rig's column for each of a recording's."""
    derived: tuple[str, ...] = ()
    """The rig's columns of which others are made, see ``_DERIVED``."""
    own_rate: bool = False
    """Whether the rate, never stated, is that of the clock to three digits, or 1 where unknown."""

    def check_path(self, path: Path) -> None:
        """Refuse the log of another design of the rig, if its path names one, e.g. designC0.

        Raises:
            RecordingError: The columns are the rig's, the leg is not.
        """
        named = re.search(r"design_?([A-Z])\.?(\d)", str(path))
        design = f"design {named[1]}.{named[2]}" if named else ""
        if design not in self.metadata.source:
            raise RecordingError(
                f"{path} is of {design} by its name, but '{self.metadata.robot}' is another robot"
                f" ({self.metadata.source}); write its own robot file, and a sidecar that names it."
            )

    def read(self, table: pl.DataFrame) -> tuple[pl.DataFrame, RecordingMetadata]:
        """Return a recording's table and metadata from the rig's own table."""
        present = [pl.col(own).alias(c) for c, own in self.columns.items() if own in table.columns]
        renamed = table.select(present).with_columns(pl.int_range(pl.len()).alias("row"))
        metadata = self.metadata
        if self.own_rate:
            time = table["t"].drop_nulls().to_numpy()
            steps = np.diff(time[np.isfinite(time)])
            step = float(np.median(steps)) if len(steps) else 0.0
            rate = float(f"{1 / step:.3g}") if 0 < step < np.inf else 1.0
            metadata = replace(metadata, rate_hz=rate)
        derived = [_DERIVED[own](table) for own in self.derived if own in table.columns]
        return renamed.with_columns(derived), metadata


def _hip_velocity(table: pl.DataFrame) -> pl.Series:
    """Return the hip's velocity command that its drive got.

    The leg swung by theta and stretched by k: q = (theta - k/2, k), with equal links. The file's
    velocity commands are those of both, yet in all segments the hip lags behind the swing as its
    damping would make it without the swing's velocity (60 ms), but not behind the stretching. So
    the drive got -k/2 alone; with it a hip gain of 13 N m/rad explains all errors alike.
    """
    return (-0.5 * table["knee_vel_cmd"]).alias(PAIRS["velocity_command"][0])


_DERIVED: dict[str, Callable[[pl.DataFrame], pl.Series]] = {
    "t_exact": lambda table: (table["t_exact"] > 0).alias("exact_time"),
    "knee_vel_cmd": _hip_velocity,
    "boom_pitch": lambda table: (BOOM_RADIUS * table["boom_pitch"].sin()).alias("base_rise_m"),
}


def _load(name: str) -> LogFormat:
    content = (resources.files("hopping_leg.identify") / "rigs" / f"{name}.toml").read_bytes()
    return read_dataclass(LogFormat, parse_toml(content, name), name, error=RecordingError)


IMPORTERS: Mapping[str, LogFormat] = {
    name: _load(name) for name in ("legv2_fixed_base", "legv1_rail", "legv2_boom", "doublependulum")
}
"""Formats by the rig's name."""


def recognise(columns: list[str]) -> LogFormat | None:
    """Return the format whose columns a table has, or none."""
    return next((f for f in IMPORTERS.values() if set(f.recognised_by).issubset(columns)), None)
