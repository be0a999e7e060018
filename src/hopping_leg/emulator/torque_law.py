"""From a command to the output's torque: the firmware's PD, zero velocity and limits.

The integral term, trajectories, flux braking, and limits by heat, speed and power are left out. A
position that is NaN is left alone; the firmware holds the one in which the mode began.
"""

import math
from dataclasses import dataclass

from moteus.protocol import Register

from hopping_leg.deploy.drive_link import DriveMode
from hopping_leg.emulator.mode_machine import Notice
from hopping_leg.emulator.settings import Settings

COMMAND_FIELDS: dict[int, str] = {
    Register.COMMAND_POSITION: "position",
    Register.COMMAND_VELOCITY: "velocity",
    Register.COMMAND_FEEDFORWARD_TORQUE: "feedforward",
    Register.COMMAND_KP_SCALE: "kp_scale",
    Register.COMMAND_KD_SCALE: "kd_scale",
    Register.COMMAND_POSITION_MAX_TORQUE: "max_torque",
    Register.COMMAND_TIMEOUT: "timeout",
    Register.COMMAND_ILIMIT_SCALE: "ilimit_scale",
}
"""Register to the field of ``Command`` that it holds."""


@dataclass(slots=True)
class Command:
    """One command; a mode write starts from these defaults. Units are the drive's: rev, s, N m."""

    mode: DriveMode = DriveMode.STOPPED
    position: float = 0.0
    velocity: float = 0.0
    feedforward: float = 0.0
    kp_scale: float = 1.0
    kd_scale: float = 1.0
    ilimit_scale: float = 1.0
    max_torque: float = 100.0
    timeout: float = 0.0
    """0 takes the configured default, NaN never times out."""


TORQUE_CONSTANT = 0.0275
"""Of the rotor, N m/A: 16 N m behind a gear of 6 take the 97 A that the board can give."""


class TorqueLaw:
    """The position controller of one drive and the limits behind it.

    ``notice`` is the limit that was at work since it was last reset, 0 if none.
    """

    def __init__(self, settings: Settings) -> None:
        self._settings, self.notice = settings, 0

    def position(self, command: Command, position: float, velocity: float) -> float:
        """Return the torque of position mode, N m; see the firmware's ``ISR_DoPositionCommon``."""
        settings = self._settings
        target = position if math.isnan(command.position) else command.position
        rate = 0.0 if math.isnan(command.velocity) else command.velocity
        torque = command.feedforward
        torque += settings["servo.pid_position.kd"] * command.kd_scale * (rate - velocity)
        torque += settings["servo.pid_position.kp"] * command.kp_scale * (target - position)
        return self._within(torque, command.max_torque, Notice.MAX_TORQUE)

    def zero_velocity(self, kd_scale: float, velocity: float) -> float:
        """Return the torque of zero-velocity mode, N m."""
        settings = self._settings
        torque = -settings["servo.pid_position.kd"] * kd_scale * velocity
        return self._within(torque, settings["servo.timeout_max_torque_Nm"], Notice.MAX_TORQUE)

    def limited(self, torque: float, position: float) -> float:
        """Return the torque that the limits leave, N m; NaN passes, as in the firmware.

        The position, rev, is the output's as reported.
        """
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
