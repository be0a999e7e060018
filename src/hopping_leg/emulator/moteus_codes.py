"""Modes and fault codes of the drives' firmware, and the machine that leads from mode to mode.

stopped --any command--> enabling -> calibrating --8.5 ms--> the commanded mode
position, stay-within --silence longer than its timeout--> timeout (11)
any but stopped --fault--> fault (1)
timeout and fault leave only through stop
"""

import math
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


ENABLING_TIME = 0.001
"""From stopped to calibrating, s."""

STARTING_TIME = 0.0085
"""From stopped to the commanded mode, s."""

_WATCHED = (MoteusMode.POSITION, MoteusMode.STAY_WITHIN)


class ModeMachine:
    """MoteusMode, fault and watchdog of one drive."""

    def __init__(self) -> None:
        self.mode = MoteusMode.STOPPED
        self.fault = 0
        """FaultCode code; in other modes than fault, the notice of the last step."""
        self.wanted = MoteusMode.STOPPED
        """What was commanded last."""
        self._started = 0.0
        self._deadline = math.inf

    def command(self, mode: MoteusMode, time: float, timeout: float) -> None:
        """Take a command.

        Args:
            mode: What is asked for.
            time: Now, s.
            timeout: Silence after which the drive leaves position mode, s; NaN for never.
        """
        if mode in BETWEEN:
            return
        self.wanted = mode
        self._deadline = math.inf if math.isnan(timeout) else time + timeout

    def trip(self, fault: FaultCode | int) -> None:
        """Go to fault; a drive that is stopped or in fault already takes no notice."""
        if self.mode not in (MoteusMode.STOPPED, MoteusMode.FAULT):
            self.mode, self.fault = MoteusMode.FAULT, int(fault)

    def advance(self, time: float, *, outside_limits: bool = False) -> bool:
        """Let time pass.

        Args:
            time: Now, s.
            outside_limits: Whether position mode may not begin where the drive stands.

        Returns:
            Whether the drive has just begun to control in another mode.
        """
        before = self.mode
        if self.wanted != self.mode:
            self._change(time, outside_limits)
        if self.mode is MoteusMode.ENABLING and time >= self._started + ENABLING_TIME:
            self.mode = MoteusMode.CALIBRATING
        if self.mode is MoteusMode.CALIBRATING and time >= self._started + STARTING_TIME:
            self.mode = MoteusMode.CALIBRATED
            self._change(time, outside_limits)
        if self.mode in _WATCHED and time >= self._deadline:
            self.mode = MoteusMode.TIMEOUT
        if self.mode is not MoteusMode.FAULT:
            self.fault = 0
        return (
            self.mode is not before and self.mode in CONTROLLING and self.mode != MoteusMode.TIMEOUT
        )

    def _change(self, time: float, outside_limits: bool) -> None:
        if self.wanted is MoteusMode.STOPPED:
            self.mode = MoteusMode.STOPPED
        elif self.mode is MoteusMode.STOPPED:
            self.mode, self._started = MoteusMode.ENABLING, time
        elif self.mode is MoteusMode.CALIBRATED or (
            self.mode in CONTROLLING and self.mode is not MoteusMode.TIMEOUT
        ):
            self.mode = self.wanted
            if self.wanted in _WATCHED and outside_limits:
                self.trip(FaultCode.START_OUTSIDE_LIMIT)
