"""Leg V2 with its base clamped: the paper's fixed-base data, recovered from vector plots.

Only the exact samples count as measured; the full-rate columns become ``*_estimate_*``, for
initial states and never for scores.
"""

import polars as pl

from hopping_leg.identify.importers.renaming import joint_columns, take
from hopping_leg.identify.setup import RecordingSetup

COLUMNS = frozenset({"n", "t", "t_exact", "hip_pos", "knee_pos", "hip_pos_cmd", "knee_pos_cmd"})

NAMES = {"t": "time_s", "t_exact": "exact_time"} | joint_columns(
    {
        "position": "{}_pos",
        "velocity": "{}_vel",
        "torque": "{}_tau",
        "position_command": "{}_pos_cmd",
        "velocity_command": "{}_vel_cmd",
        "position_estimate": "{}_pos_interp",
        "velocity_estimate": "{}_vel_interp",
    },
    ("hip", "knee"),
)

SETUP = RecordingSetup(
    rig="fixed-base",
    rate_hz=200.0,
    robot="legv2",
    source="leg V2, two mjbots qdd100, base clamped, lab's experiment DC-R1; samples recovered"
    " from vector plots; gains are the middle of what regression gives",
    sample="before-command",
    onboard="continuous",
    stiffness=(1.5, 32.0),
    damping=(0.55, 1.6),
    integral=(3.2, 0.0),
    gains_exact=False,
)
"""Row n is in the reply to command n; the motors track at tens of kHz, without feed-forward."""


def read(table: pl.DataFrame) -> tuple[pl.DataFrame, RecordingSetup]:
    """Return the recording's table and setup."""
    return take(table, NAMES).with_columns(pl.col("exact_time") > 0), SETUP
