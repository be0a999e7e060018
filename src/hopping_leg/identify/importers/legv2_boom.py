"""Leg V2 on a boom, hopping on torque commands at 130 Hz."""

import polars as pl

from hopping_leg.identify.importers.renaming import joint_columns, take
from hopping_leg.identify.recording_format import RecordingMetadata

COLUMNS = frozenset({"t", "phase", "hip_pos", "hip_vel", "knee_pos", "knee_vel"})

BOOM_RADIUS = 1.146
"""Base rise per sine of boom pitch, m."""

NAMES = {"t": "time_s", "phase": "phase"} | joint_columns(
    {
        "position": "{}_pos",
        "velocity": "{}_vel",
        "torque": "{}_tau",
        "torque_command": "{}_tau_cmd",
    },
    ("hip", "knee"),
)

METADATA = RecordingMetadata(
    rig="boom",
    rate_hz=130.0,
    robot="legv2",
    source="leg V2 on a boom, two mjbots qdd100, torque commands; measured torque answers one row"
    " later with gain 0.91; base rise from boom pitch with radius 1.146 m (+-0.1 m where torques"
    " were not kept)",
    effective_gravity=4.5,
    sample="before-command",
    onboard="torque",
    startup_rows=3,
)
"""Command n was computed from row n-1 and acts from row n's time on; gravity is that of free
flight, with the boom's inertia and counterweight."""


def read(table: pl.DataFrame) -> tuple[pl.DataFrame, RecordingMetadata]:
    """Return the recording's table and metadata."""
    recording = take(table, NAMES)
    if "boom_pitch" in table.columns:
        rise = BOOM_RADIUS * table["boom_pitch"].sin()
        recording = recording.with_columns(rise.alias("base_rise_m"))
    return recording, METADATA
