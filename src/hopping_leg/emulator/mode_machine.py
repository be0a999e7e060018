"""The drives' mode machine: what a command leads to, what faults and silence lead to.

stopped --any command--> enabling -> calibrating --8.5 ms--> the commanded mode
position --silence longer than its timeout--> timeout (11)
any but stopped --fault--> fault (1)
timeout and fault leave only through stop
"""

import math
from enum import IntEnum

from hopping_leg.deploy.drive_link import DriveMode, FaultCode


class Notice(IntEnum):
    """Which limit is at work, in the same register; the drive goes on."""

    MAX_VOLTAGE = 98
    MAX_CURRENT = 99
    MAX_TORQUE = 102
    POSITION_BOUNDS = 103


BETWEEN = (DriveMode.FAULT, DriveMode.ENABLING, DriveMode.CALIBRATING, DriveMode.CALIBRATED)
"""Modes that no command can ask for."""

MODES = frozenset(DriveMode)  # All that a register may hold
CONTROLLING = MODES - {DriveMode.STOPPED, *BETWEEN}  # Modes in which the output stage is powered


_ENABLING_TIME = 0.001  # From stopped to calibrating, s

STARTING_TIME = 0.0085  # From stopped to the commanded mode, s


class ModeMachine:
    """DriveMode, fault and watchdog of one drive."""

    def __init__(self) -> None:
        self.mode = DriveMode.STOPPED
        self.fault = 0  # FaultCode code; in other modes than fault, the notice of the last step
        self.wanted = DriveMode.STOPPED  # What was commanded last
        self._started = 0.0
        self._deadline = math.inf

    def command(self, mode: DriveMode, time: float, timeout: float) -> None:
        """Take a command; after a silence of ``timeout``, s, position mode ends; NaN for never."""
        if mode in BETWEEN:
            return
        self.wanted = mode
        self._deadline = math.inf if math.isnan(timeout) else time + timeout

    def trip(self, fault: FaultCode | int) -> None:
        """Go to fault; a drive that is stopped or in fault already takes no notice."""
        if self.mode not in (DriveMode.STOPPED, DriveMode.FAULT):
            self.mode, self.fault = DriveMode.FAULT, int(fault)

    def advance(self, time: float, *, outside_limits: bool = False) -> None:
        """Let time pass; ``outside_limits`` tells that position mode may not begin here."""
        if self.wanted != self.mode:
            self._change(time, outside_limits)
        if self.mode is DriveMode.ENABLING and time >= self._started + _ENABLING_TIME:
            self.mode = DriveMode.CALIBRATING
        if self.mode is DriveMode.CALIBRATING and time >= self._started + STARTING_TIME:
            self.mode = DriveMode.CALIBRATED
            self._change(time, outside_limits)
        if self.mode is DriveMode.POSITION and time >= self._deadline:
            self.mode = DriveMode.TIMEOUT
        if self.mode is not DriveMode.FAULT:
            self.fault = 0

    def _change(self, time: float, outside_limits: bool) -> None:
        if self.wanted is DriveMode.STOPPED:
            self.mode = DriveMode.STOPPED
        elif self.mode is DriveMode.STOPPED:
            self.mode, self._started = DriveMode.ENABLING, time
        elif self.mode is DriveMode.CALIBRATED or self.mode in CONTROLLING - {DriveMode.TIMEOUT}:
            self.mode = self.wanted
            if self.wanted is DriveMode.POSITION and outside_limits:
                self.trip(FaultCode.START_OUTSIDE_LIMIT)
