"""What the host commanded last: the command registers as the firmware keeps them."""

import math
from dataclasses import dataclass

from moteus.protocol import Register

from hopping_leg.emulator.moteus_codes import MoteusMode

_FIELDS = {
    Register.COMMAND_POSITION: "position",
    Register.COMMAND_VELOCITY: "velocity",
    Register.COMMAND_FEEDFORWARD_TORQUE: "feedforward",
    Register.COMMAND_KP_SCALE: "kp_scale",
    Register.COMMAND_KD_SCALE: "kd_scale",
    Register.COMMAND_POSITION_MAX_TORQUE: "max_torque",
    Register.COMMAND_STOP_POSITION: "stop_position",
    Register.COMMAND_TIMEOUT: "timeout",
    Register.COMMAND_VELOCITY_LIMIT: "velocity_limit",
    Register.COMMAND_ACCEL_LIMIT: "accel_limit",
    Register.COMMAND_FIXED_VOLTAGE_OVERRIDE: "fixed_voltage",
    Register.COMMAND_ILIMIT_SCALE: "ilimit_scale",
    Register.COMMAND_FIXED_CURRENT_OVERRIDE: "fixed_current",
    Register.COMMAND_IGNORE_POSITION_BOUNDS: "ignore_bounds",
    Register.COMMAND_WITHIN_LOWER_BOUND: "lower",
    Register.COMMAND_WITHIN_UPPER_BOUND: "upper",
    Register.COMMAND_WITHIN_FEEDFORWARD_TORQUE: "feedforward",
    Register.COMMAND_WITHIN_KP_SCALE: "kp_scale",
    Register.COMMAND_WITHIN_KD_SCALE: "kd_scale",
    Register.COMMAND_WITHIN_MAX_TORQUE: "max_torque",
    Register.COMMAND_WITHIN_TIMEOUT: "timeout",
    Register.COMMAND_WITHIN_ILIMIT_SCALE: "ilimit_scale",
    Register.COMMAND_WITHIN_IGNORE_POSITION_BOUNDS: "ignore_bounds",
}

COMMAND_FIELDS = {int(register): name for register, name in _FIELDS.items()}
"""Register to the field of ``Command`` that it holds."""


@dataclass
class Command:
    """One command; a mode write starts from these defaults. Units are the drive's: rev, s, N m."""

    mode: MoteusMode = MoteusMode.STOPPED
    position: float = 0.0
    """NaN leaves position alone."""
    velocity: float = 0.0
    feedforward: float = 0.0
    kp_scale: float = 1.0
    kd_scale: float = 1.0
    ilimit_scale: float = 1.0
    max_torque: float = 100.0
    stop_position: float = math.nan
    timeout: float = 0.0
    """0 takes the configured default, NaN never times out."""
    velocity_limit: float = math.nan
    accel_limit: float = math.nan
    fixed_voltage: float = math.nan
    fixed_current: float = math.nan
    ignore_bounds: float = 0.0
    lower: float = 0.0
    upper: float = 0.0
