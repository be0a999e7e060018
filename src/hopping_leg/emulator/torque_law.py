"""From a command to the output's torque: the firmware's PD, zero velocity and limits.

The integral term, trajectories, flux braking, and limits by heat, speed and power are left out. A
position that is NaN is left alone; the firmware holds the one in which the mode began.
"""

import math

from moteus.protocol import Register

from hopping_leg.emulator.mode_machine import Notice
from hopping_leg.emulator.settings import Settings

NEW_COMMAND: dict[int, float] = {
    Register.COMMAND_POSITION: 0.0,
    Register.COMMAND_VELOCITY: 0.0,
    Register.COMMAND_FEEDFORWARD_TORQUE: 0.0,
    Register.COMMAND_KP_SCALE: 1.0,
    Register.COMMAND_KD_SCALE: 1.0,
    Register.COMMAND_ILIMIT_SCALE: 1.0,
    Register.COMMAND_POSITION_MAX_TORQUE: 100.0,
    Register.COMMAND_TIMEOUT: 0.0,
}
"""What a mode write makes of a command, in the units of the drive: rev, s, N m. A timeout
of 0 takes the configured one, NaN never times out."""

TORQUE_CONSTANT = 0.0275
"""Of the rotor, N m/A: 16 N m behind a gear of 6 take the 97 A that the board can give."""


class TorqueLaw:
    """Position control of one drive; ``notice`` is the limit that was at work since its reset."""

    def __init__(self, settings: Settings) -> None:
        self._settings, self.notice = settings, 0

    def position(self, command: dict[int, float], position: float, velocity: float) -> float:
        """Return the torque of position mode, N m; see the firmware's ``ISR_DoPositionCommon``."""
        target, rate, torque, kp, kd, _, most, _ = command.values()
        target = position if math.isnan(target) else target
        rate = 0.0 if math.isnan(rate) else rate
        torque += self._settings["servo.pid_position.kd"] * kd * (rate - velocity)
        torque += self._settings["servo.pid_position.kp"] * kp * (target - position)
        return self._within(torque, most, Notice.MAX_TORQUE)

    def zero_velocity(self, kd_scale: float, velocity: float) -> float:
        """Return the torque of zero-velocity mode, N m."""
        settings = self._settings
        torque = -settings["servo.pid_position.kd"] * kd_scale * velocity
        return self._within(torque, settings["servo.timeout_max_torque_Nm"], Notice.MAX_TORQUE)

    def limited(self, torque: float, position: float) -> float:
        """Return the torque that the limits leave at a reported position, rev; NaN passes."""
        settings = self._settings
        low, high = settings["servopos.position_min"], settings["servopos.position_max"]
        beyond = max(position - high, 0.0) if torque > 0 else max(low - position, 0.0)
        if beyond > 0:
            self.notice = Notice.POSITION_BOUNDS
            torque *= max(0.0, 1 - beyond / settings["servo.position_derate"])
        ratio = settings["motor_position.rotor_to_output_ratio"]
        most = settings["servo.max_current_A"] * TORQUE_CONSTANT / ratio
        return self._within(torque, most, Notice.MAX_CURRENT)

    def _within(self, torque: float, most: float, notice: Notice) -> float:
        if abs(torque) > most:
            self.notice = notice
            return math.copysign(most, torque)
        return torque
