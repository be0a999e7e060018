"""The drive's mode machine: what a command leads to, what faults and silence lead to.

stopped --any command--> enabling -> calibrating --8.5 ms--> the commanded mode
position, stay-within --silence longer than its timeout--> timeout (11)
any but stopped --fault--> fault (1)
timeout and fault leave only through stop
"""

import math

from hopping_leg.emulator.codes import BETWEEN, CONTROLLING, Fault, Mode

ENABLING_TIME = 0.001
"""From stopped to calibrating, s."""

STARTING_TIME = 0.0085
"""From stopped to the commanded mode, s."""

_WATCHED = (Mode.POSITION, Mode.STAY_WITHIN)


class ModeMachine:
    """Mode, fault and watchdog of one drive."""

    def __init__(self) -> None:
        self.mode = Mode.STOPPED
        self.fault = 0
        """Fault code; in other modes than fault, the notice of the last step."""
        self.wanted = Mode.STOPPED
        """What was commanded last."""
        self._started = 0.0
        self._deadline = math.inf

    def command(self, mode: Mode, time: float, timeout: float) -> None:
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

    def trip(self, fault: Fault | int) -> None:
        """Go to fault; a drive that is stopped or in fault already takes no notice."""
        if self.mode not in (Mode.STOPPED, Mode.FAULT):
            self.mode, self.fault = Mode.FAULT, int(fault)

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
        if self.mode is Mode.ENABLING and time >= self._started + ENABLING_TIME:
            self.mode = Mode.CALIBRATING
        if self.mode is Mode.CALIBRATING and time >= self._started + STARTING_TIME:
            self.mode = Mode.CALIBRATED
            self._change(time, outside_limits)
        if self.mode in _WATCHED and time >= self._deadline:
            self.mode = Mode.TIMEOUT
        if self.mode is not Mode.FAULT:
            self.fault = 0
        return self.mode is not before and self.mode in CONTROLLING and self.mode != Mode.TIMEOUT

    def _change(self, time: float, outside_limits: bool) -> None:
        if self.wanted is Mode.STOPPED:
            self.mode = Mode.STOPPED
        elif self.mode is Mode.STOPPED:
            self.mode, self._started = Mode.ENABLING, time
        elif self.mode is Mode.CALIBRATED or (
            self.mode in CONTROLLING and self.mode is not Mode.TIMEOUT
        ):
            self.mode = self.wanted
            if self.wanted in _WATCHED and outside_limits:
                self.trip(Fault.START_OUTSIDE_LIMIT)
