"""Recordings of other loggers, recognised by their columns."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import polars as pl

from hopping_leg.errors import RecordingError
from hopping_leg.identify.recording_format import PAIRS, Quantisation, RecordingMetadata

BOOM_RADIUS = 1.146
"""Base rise per sine of boom pitch, m."""


def _joint_columns(patterns: Mapping[str, str], hip: str, knee: str) -> dict[str, str]:
    return {
        pattern.format(joint): column
        for quantity, pattern in patterns.items()
        for joint, column in zip((hip, knee), PAIRS[quantity], strict=True)
    }


def _base_rise(table: pl.DataFrame) -> list[pl.Series]:
    present = "boom_pitch" in table.columns
    return [(BOOM_RADIUS * table["boom_pitch"].sin()).alias("base_rise_m")] if present else []


def _hip_velocity(table: pl.DataFrame) -> list[pl.Series]:
    """Return the hip's velocity command that its drive got.

    The leg swung by theta and stretched by k: q = (theta - k/2, k), with equal links. The file's
    velocity commands are those of both, yet in all segments the hip lags behind the swing as its
    damping would make it without the swing's velocity (60 ms), but not behind the stretching. So
    the drive got -k/2 alone; with it a hip gain of 13 N m/rad explains all errors alike.
    """
    columns = [(table["t_exact"] > 0).alias("exact_time")]
    if "knee_vel_cmd" in table.columns:
        columns.append((-0.5 * table["knee_vel_cmd"]).alias(PAIRS["velocity_command"][0]))
    return columns


@dataclass(frozen=True)
class LogFormat:
    """Tables of one rig's logger."""

    columns: frozenset[str]
    """Columns by which the rig is recognised."""
    names: dict[str, str]
    """A recording's column for each of the rig's."""
    metadata: RecordingMetadata
    derived: Callable[[pl.DataFrame], list[pl.Series]] = lambda _table: []
    """From the rig's table to columns of the recording beside those that are renamed."""
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
        present = [pl.col(a).alias(b) for a, b in self.names.items() if a in table.columns]
        renamed = table.select(present).with_columns(pl.int_range(pl.len()).alias("row"))
        metadata = self.metadata
        if self.own_rate:
            time = table["t"].drop_nulls().to_numpy()
            steps = np.diff(time[np.isfinite(time)])
            step = float(np.median(steps)) if len(steps) else 0.0
            rate = float(f"{1 / step:.3g}") if 0 < step < np.inf else 1.0
            metadata = replace(metadata, rate_hz=rate)
        return renamed.with_columns(self.derived(table)), metadata


_MEASURED = {"position": "{}_pos", "velocity": "{}_vel", "torque": "{}_tau"}
_TARGETS = {"position_command": "{}_pos_cmd", "velocity_command": "{}_vel_cmd"}
_ESTIMATES = {"position_estimate": "{}_pos_interp", "velocity_estimate": "{}_vel_interp"}

IMPORTERS = {
    # The paper's fixed-base data, recovered from vector plots. Row n is in the reply to command n;
    # the motors track at tens of kHz, without feed-forward. Only the exact samples count as
    # measured; the full-rate columns are estimates, for initial states and never for scores.
    "legv2_fixed_base": LogFormat(
        frozenset({"n", "t", "t_exact", "hip_pos", "knee_pos", "hip_pos_cmd", "knee_pos_cmd"}),
        {"t": "time_s", "t_exact": "exact_time"}
        | _joint_columns(_MEASURED | _TARGETS | _ESTIMATES, "hip", "knee"),
        RecordingMetadata(
            rig="fixed-base",
            rate_hz=200.0,
            robot="legv2",
            source="leg V2, two mjbots qdd100, base clamped, lab's experiment DC-R1; samples"
            " recovered from vector plots; gains by regression on the spectra of torques and"
            " errors",
            onboard="continuous",
            stiffness=(13.0, 65.0),
            damping=(0.8, 4.0),
            gains_exact=False,
        ),
        _hip_velocity,
    ),
    # Leg V1 hopping on the vertical rail under energy shaping.
    "legv1_rail": LogFormat(
        frozenset({"t", "hip_pos", "hip_tau_ff_cmd", "knee_pos", "knee_tau_ff_cmd"}),
        {"t": "time_s"}
        | _joint_columns(_MEASURED | _TARGETS | {"torque_command": "{}_tau_ff_cmd"}, "hip", "knee"),
        RecordingMetadata(
            rig="rail",
            rate_hz=630.0,
            robot="legv1",
            source="leg V1, T-Motor AK80, energy shaping on the rail; torque lags about two rows; a"
            " commanded 13.9 N m measures about 10.7; gains in the lab's script: lift-off 1/1,"
            " touchdown 5/0.1, otherwise 50/2 (N m/rad, N m s/rad), the phase is not in the log",
            onboard="continuous",
            gains_exact=False,
            quantisation=Quantisation(position=2.914e-3, velocity=0.02198, torque=0.00879),
        ),
        own_rate=True,
    ),
    # Leg V2 on a boom, hopping on torque commands. Command n was computed from row n-1 and acts
    # from row n's time on; gravity is that of free flight, with the boom's inertia and
    # counterweight.
    "legv2_boom": LogFormat(
        frozenset({"t", "phase", "hip_pos", "hip_vel", "knee_pos", "knee_vel"}),
        {"t": "time_s", "phase": "phase"}
        | _joint_columns(_MEASURED | {"torque_command": "{}_tau_cmd"}, "hip", "knee"),
        RecordingMetadata(
            rig="boom",
            rate_hz=130.0,
            robot="legv2",
            source="leg V2 on a boom, two mjbots qdd100, torque commands; measured torque answers"
            " one row later with gain 0.91; base rise from boom pitch with radius 1.146 m"
            " (+-0.1 m where torques were not kept)",
            effective_gravity=4.5,
            startup_rows=3,
        ),
        _base_rise,
    ),
    # The two-link pendulum of the same lab: base clamped, torque commands. Joint 1 is the hip,
    # joint 2 the knee; steps of the sensors as seen in the recordings, which all begin at zero to
    # within one.
    "doublependulum": LogFormat(
        frozenset({"t", "pos_meas1", "pos_meas2", "tau_con1", "tau_con2"}),
        {"t": "time_s"}
        | _joint_columns(
            {
                "position": "pos_meas{}",
                "velocity": "vel_meas{}",
                "torque": "tau_meas{}",
                "torque_command": "tau_con{}",
            },
            "1",
            "2",
        ),
        RecordingMetadata(
            rig="fixed-base",
            rate_hz=500.0,
            robot="doublependulum",
            source="two-link pendulum, design A.0 (0.3 m, 0.2 m), T-Motor AK80-6, torque commands",
            zeroed=True,
            quantisation=Quantisation(position=3.815e-4, velocity=0.03297, torque=0.00586),
        ),
        own_rate=True,
    ),
}
"""Formats by the rig's name."""


def recognise(columns: list[str]) -> LogFormat | None:
    """Return the format whose columns a table has, or none."""
    return next((f for f in IMPORTERS.values() if f.columns.issubset(columns)), None)
