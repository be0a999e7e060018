"""Where real recordings lie, and a made-up run that every check accepts."""

import os
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from hopping_leg.identify.recording_format import RecordingMetadata

RECORDINGS = Path(
    os.environ.get(
        "HOPPING_LEG_RECORDINGS", Path(__file__).parents[2].parent / "shared" / "recordings"
    )
)

needs_recordings = pytest.mark.skipif(
    not RECORDINGS.is_dir(),
    reason=f"no real recordings in {RECORDINGS}; set HOPPING_LEG_RECORDINGS",
)

METADATA = RecordingMetadata(rig="fixed-base", rate_hz=200.0, robot="legv2", source="made up")

SIDECAR = """
rig = "fixed-base"
rate_hz = 200.0
robot = "legv2"
source = "made up"
"""


def swinging(rows=600, rate=200.0):
    """Return a clean table: both joints swing, torques follow their commands."""
    t = np.arange(rows) / rate
    hip, knee = 0.5 * np.sin(3 * t), -1.2 + 0.6 * np.cos(5 * t)
    return pl.DataFrame(
        {
            "time_s": t,
            "hip_position_rad": hip,
            "knee_position_rad": knee,
            "hip_velocity_rad_s": 1.5 * np.cos(3 * t),
            "knee_velocity_rad_s": -3.0 * np.sin(5 * t),
            "hip_torque_nm": 0.3 + np.sin(3 * t),
            "knee_torque_nm": 0.2 + np.cos(5 * t),
            "hip_command_nm": 0.3 + np.sin(3 * t),
            "knee_command_nm": 0.2 + np.cos(5 * t),
            "hip_position_command_rad": hip + 0.01,
            "knee_position_command_rad": knee - 0.01,
        }
    )


def rig_log(clock="t", rows=600):
    """Return a table as the double pendulum's rig logs it."""
    names = ["pos_meas1", "pos_meas2", "vel_meas1", "vel_meas2", "tau_con1", "tau_con2"]
    table = swinging(rows, rate=500.0)
    return table[:, :7].rename(dict(zip(table.columns[:7], [clock, *names], strict=True)))


def write_run(folder, table, sidecar=SIDECAR, name="run.csv"):
    """Write a table as CSV with its sidecar; return the CSV's path."""
    path = folder / name
    table.write_csv(path)
    path.with_suffix(".toml").write_text(sidecar)
    return path
