"""The two-link pendulum of the same lab: base clamped, torque commands."""

import dataclasses

import polars as pl

from hopping_leg.identify.importers.renaming import joint_columns, median_rate, take
from hopping_leg.identify.recording_format import Quantisation, RecordingMetadata

COLUMNS = frozenset({"t", "pos_meas1", "pos_meas2", "tau_con1", "tau_con2"})

NAMES = {"t": "time_s"} | joint_columns(
    {
        "position": "pos_meas{}",
        "velocity": "vel_meas{}",
        "torque": "tau_meas{}",
        "torque_command": "tau_con{}",
    },
    ("1", "2"),
)

METADATA = RecordingMetadata(
    rig="fixed-base",
    rate_hz=500.0,
    robot="doublependulum",
    source="two-link pendulum, design A.0 (0.3 m, 0.2 m), T-Motor AK80-6, torque commands",
    sample="before-command",
    onboard="torque",
    zeroed=True,
    quantisation=Quantisation(position=3.815e-4, velocity=0.03297, torque=0.00586),
)
"""Joint 1 is the hip, joint 2 the knee; steps of the sensors as seen in the recordings, which all
begin at zero to within one."""


def read(table: pl.DataFrame) -> tuple[pl.DataFrame, RecordingMetadata]:
    """Return the recording's table and metadata; the rate is the clock's own."""
    return take(table, NAMES), dataclasses.replace(METADATA, rate_hz=median_rate(table["t"]))
