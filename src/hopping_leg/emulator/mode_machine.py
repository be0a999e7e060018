"""The drive's mode machine: what a command leads to, what faults and silence lead to.

stopped --any command--> enabling -> calibrating --8.5 ms--> the commanded mode
position, stay-within --silence longer than its timeout--> timeout (11)
any but stopped --fault--> fault (1)
timeout and fault leave only through stop
"""

import math

from hopping_leg.emulator.moteus_codes import BETWEEN, CONTROLLING, FaultCode, MoteusMode

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
