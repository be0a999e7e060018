"""Leg V2 with its base clamped: the paper's fixed-base data, recovered from vector plots.

The foot moved along q = (theta - k/2, k): the leg swung by theta and stretched by k, with equal
links. The file's velocity commands are those of both motions, yet the drives got the stretching's
alone: in all segments, with stretching periods of 0.25 s to 1 s and swinging ones of 5 s to 40 s,
the hip lags behind the swing as its damping would make it without the swing's velocity
(60 ms), but not behind the stretching. So the hip's velocity command here is that of -k/2.
With it, a hip gain of 13 N m/rad and no integral explain the mean, the slow and the fast errors
alike.

Only the exact samples count as measured; the full-rate columns become ``*_estimate_*``, for
initial states and never for scores.
"""

import polars as pl

from hopping_leg.identify.columns import PAIRS
from hopping_leg.identify.importers.renaming import joint_columns, take
from hopping_leg.identify.recording_format import RecordingMetadata

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

METADATA = RecordingMetadata(
    rig="fixed-base",
    rate_hz=200.0,
    robot="legv2",
    source="leg V2, two mjbots qdd100, base clamped, lab's experiment DC-R1; samples recovered"
    " from vector plots; gains by regression on the spectra of torques and errors",
    sample="before-command",
    onboard="continuous",
    stiffness=(13.0, 65.0),
    damping=(0.8, 4.0),
    gains_exact=False,
)
"""Row n is in the reply to command n; the motors track at tens of kHz, without feed-forward."""


def read(table: pl.DataFrame) -> tuple[pl.DataFrame, RecordingMetadata]:
    """Return the recording's table and metadata."""
    hip, knee = PAIRS["velocity_command"]
    taken = take(table, NAMES).with_columns(pl.col("exact_time") > 0)
    if knee in taken.columns:
        taken = taken.with_columns((-0.5 * pl.col(knee)).alias(hip))
    return taken, METADATA
