"""The columns of a recording: SI units, at the joints, null where nothing was recorded."""

import polars as pl

JOINTS = ("hip", "knee")

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
"""Quantities that hip and knee both have, each with its two columns."""

_MEANINGS = {
    "position": "joint position, measured",
    "velocity": "joint velocity, measured",
    "torque": "joint torque, measured",
    "position_command": "target position of the on-board PD",
    "velocity_command": "target velocity of the on-board PD",
    "torque_command": "commanded torque; feed-forward where there is an on-board PD",
    "stiffness": "gain of the on-board PD at this row, where it changes",
    "damping": "gain of the on-board PD at this row, where it changes",
    "position_estimate": "guess at the position where it was not measured; never scored",
    "velocity_estimate": "guess at the velocity where it was not measured; never scored",
}

COLUMNS: dict[str, tuple[type[pl.DataType], str]] = {
    "time_s": (pl.Float64, "when the row was sampled"),
    "row": (pl.Int64, "row of the source file, the first below the header is 0"),
    "exact_time": (pl.Boolean, "false where the time stamp is a guess"),
    "height_m": (pl.Float64, "hip axis above the ground"),
    "base_rise_m": (pl.Float64, "base height above an unknown zero"),
    "contact": (pl.Boolean, "the foot touches the ground"),
    "phase": (pl.String, "what the rig's controller was doing"),
} | {
    column: (pl.Float64, f"{joint}: {_MEANINGS[quantity]}")
    for quantity, columns in PAIRS.items()
    for joint, column in zip(JOINTS, columns, strict=True)
}
"""Every column of a recording: type and meaning. Only time and one position are required."""

MEASURED = tuple(c for q in ("position", "velocity", "torque") for c in PAIRS[q])
"""Columns that sensors filled."""
