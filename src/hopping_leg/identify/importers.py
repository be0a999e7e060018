"""Recordings of other loggers, recognised by their columns; a rig's format is a file in rigs/."""

import itertools
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from importlib import resources
from pathlib import Path

import numpy as np
import polars as pl

from hopping_leg.errors import RecordingError
from hopping_leg.identify.recording_format import PAIRS, RecordingMetadata, cast, sidecar_path
from hopping_leg.io import parse_toml, read_dataclass
from hopping_leg.robot import JOINTS, Boom, load_robot


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
    mirrored: bool = False
    """Whether the log's angles, velocities and torques have the other sign."""
    before_belt: tuple[str, ...] = ()
    """Joints whose torques were logged before the belt, which multiplies them by its ratio."""


LAB_FILES = ("stateData", "encoderData")
"""Tables of the lab's folders, row by row beside each other."""


def _hip_velocity(table: pl.DataFrame, _: Boom) -> pl.Series:
    """Return the hip's velocity command that its drive got.

    The leg swung by theta and stretched by k: q = (theta - k/2, k), with equal links. In all
    segments the hip lags behind the swing as its damping makes it without the swing's velocity
    (60 ms), but not behind the stretching, so the drive got -k/2 alone, not what the file says.
    """
    return (-0.5 * table["knee_vel_cmd"]).alias(PAIRS["velocity_command"][0])


_DERIVED: dict[str, Callable[[pl.DataFrame, Boom], pl.Series]] = {
    "t_exact": lambda table, _: (table["t_exact"] > 0).alias("exact_time"),
    "knee_vel_cmd": _hip_velocity,
    "boom_pitch": lambda t, boom: (boom.radius * t["boom_pitch"].sin()).alias("base_rise_m"),
    "pitch_pos": lambda t, b: (b.pivot + b.radius * t["pitch_pos"].sin()).alias("height_m"),
}


RIGS = ("legv2_fixed_base", "legv1_rail", "legv2_boom_200hz", "legv2_boom", "doublependulum")
"""Names of the known rigs."""


@cache
def log_format(name: str) -> LogFormat:
    """Return the format of a rig."""
    content = (resources.files("hopping_leg.identify") / "rigs" / f"{name}.toml").read_bytes()
    return read_dataclass(LogFormat, parse_toml(content, name), name, error=RecordingError)


def read_log(table: pl.DataFrame, path: Path) -> tuple[pl.DataFrame, RecordingMetadata]:
    """Return a recording's table and metadata from a known rig's own table.

    RecordingError says that no rig has such columns, or that the path names another design of the
    rig than the robot's, e.g. designC0.
    """
    if "t" not in table.columns:  # the same logs before they were converted
        table = table.rename({"time": "t"}, strict=False)
    known = (f for f in map(log_format, RIGS) if set(f.recognised_by).issubset(table.columns))
    rig = next(known, None)
    if rig is None:
        raise RecordingError(
            f"{path} is of no known rig ({', '.join(RIGS)}) and there is no sidecar"
            f" {sidecar_path(path).name} beside it; its columns are:"
            f" {', '.join(table.columns[:12])}."
        )
    named = re.search(r"design_?([A-Z])\.?(\d)", str(path))
    design = f"design {named[1]}.{named[2]}" if named else ""
    if design not in rig.metadata.source:
        raise RecordingError(
            f"{path} is of {design} by its name, but '{rig.metadata.robot}' is another robot;"
            " write its own robot file, and a sidecar that names it."
        )
    own = set(rig.columns.values())  # some logs call commands desired
    desired = {f"{c[:-4]}_des": c for c in own - set(table.columns) if c.endswith("_cmd")}
    table = table.rename(desired, strict=False)
    table = cast(table, {c: pl.String if c == "phase" else pl.Float64 for c in table.columns}, path)
    metadata = rig.metadata
    if rig.own_rate:
        steps = np.diff(table["t"].fill_nan(None).drop_nulls().to_numpy())
        step = float(np.median(steps)) if len(steps) else 0.0
        rate = float(f"{1 / step:.3g}") if 0 < step < np.inf else 1.0
        metadata = replace(metadata, rate_hz=rate)
    present = [pl.col(own).alias(c) for c, own in rig.columns.items() if own in table.columns]
    boom = metadata.boom
    derived = [_DERIVED[own](table, boom) for own in rig.derived if own in table.columns]
    renamed = table.select(present).with_columns(pl.int_range(pl.len()).alias("row"))
    # the joints' columns with the robot's signs, and torques after the belt
    signs = dict.fromkeys(itertools.chain(*PAIRS.values()), -1.0 if rig.mirrored else 1.0)
    for joint in rig.before_belt:
        ratio = getattr(load_robot(rig.metadata.robot), joint).belt_ratio
        for name in ("torque", "torque_command"):
            signs[PAIRS[name][JOINTS.index(joint)]] *= ratio
    own_signs = [pl.col(c) * sign for c, sign in signs.items() if c in renamed.columns]
    return renamed.with_columns(own_signs).with_columns(derived), metadata
