"""Leg V1 hopping on the vertical rail under energy shaping."""

import dataclasses

import polars as pl

from hopping_leg.identify.importers.renaming import joint_columns, median_rate, take
from hopping_leg.identify.recording_format import Quantisation, RecordingMetadata

COLUMNS = frozenset({"t", "hip_pos", "hip_tau_ff_cmd", "knee_pos", "knee_tau_ff_cmd"})

NAMES = {"t": "time_s"} | joint_columns(
    {
        "position": "{}_pos",
        "velocity": "{}_vel",
        "torque": "{}_tau",
        "position_command": "{}_pos_cmd",
        "velocity_command": "{}_vel_cmd",
        "torque_command": "{}_tau_ff_cmd",
    },
    ("hip", "knee"),
)

METADATA = RecordingMetadata(
    rig="rail",
    rate_hz=630.0,
    robot="legv1",
    source="leg V1, T-Motor AK80, energy shaping on the rail; torque lags about two rows; a"
    " commanded 13.9 N m measures about 10.7; gains in the lab's script: lift-off 1/1, touchdown"
    " 5/0.1, otherwise 50/2 (N m/rad, N m s/rad), the phase is not in the log",
    sample="before-command",
    onboard="continuous",
    gains_exact=False,
    quantisation=Quantisation(position=2.914e-3, velocity=0.02198, torque=0.00879),
)


def read(table: pl.DataFrame) -> tuple[pl.DataFrame, RecordingMetadata]:
    """Return the recording's table and metadata; the rate is the clock's own."""
    return take(table, NAMES), dataclasses.replace(METADATA, rate_hz=median_rate(table["t"]))
