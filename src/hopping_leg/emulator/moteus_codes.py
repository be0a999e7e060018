"""Modes and fault codes of the drives' firmware."""

from enum import IntEnum


class MoteusMode(IntEnum):
    """State of a drive, register 0x000; 2 to 4 cannot be asked for."""

    STOPPED = 0
    FAULT = 1
    ENABLING = 2
    CALIBRATING = 3
    CALIBRATED = 4
    PWM = 5
    VOLTAGE = 6
    VOLTAGE_FOC = 7
    VOLTAGE_DQ = 8
    CURRENT = 9
    POSITION = 10
    TIMEOUT = 11
    ZERO_VELOCITY = 12
    STAY_WITHIN = 13
    MEASURE_INDUCTANCE = 14
    BRAKE = 15


class FaultCode(IntEnum):
    """Why a drive is in fault, register 0x00f."""

    NONE = 0
    CALIBRATION = 32
    MOTOR_DRIVER = 33
    OVER_VOLTAGE = 34
    ENCODER = 35
    MOTOR_NOT_CONFIGURED = 36
    PWM_CYCLE_OVERRUN = 37
    OVER_TEMPERATURE = 38
    START_OUTSIDE_LIMIT = 39
    UNDER_VOLTAGE = 40
    CONFIG_CHANGED = 41
    THETA_INVALID = 42
    POSITION_INVALID = 43
    DRIVER_ENABLE = 44
    STOP_POSITION_DEPRECATED = 45
    TIMING_VIOLATION = 46
    BEMF_FEEDFORWARD_NO_ACCEL_LIMIT = 47
    INVALID_LIMITS = 48
    POSITION_ERROR = 49
    VELOCITY_ERROR = 50


class Notice(IntEnum):
    """Which limit is at work, in the same register; the drive goes on."""

    MAX_VELOCITY = 96
    MAX_POWER = 97
    MAX_VOLTAGE = 98
    MAX_CURRENT = 99
    FET_TEMPERATURE = 100
    MOTOR_TEMPERATURE = 101
    MAX_TORQUE = 102
    POSITION_BOUNDS = 103
    OTHER = 104
    FLUX_BRAKING = 105


BETWEEN = (MoteusMode.FAULT, MoteusMode.ENABLING, MoteusMode.CALIBRATING, MoteusMode.CALIBRATED)
"""Modes that no command can ask for."""

MODES = frozenset(MoteusMode)
"""All that a register may hold."""

CONTROLLING = MODES - {MoteusMode.STOPPED, *BETWEEN}
"""Modes in which the output stage is powered."""
