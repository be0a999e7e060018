"""From a command to the output's torque: the firmware's PD, zero velocity and limits.

The integral term, trajectories, flux braking and power limits are left out.
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
    Register.COMMAND_IGNORE_POSITION_BOUNDS: "ignore_bounds",
}
"""Register to the field of ``Command`` that it holds."""


@dataclass(slots=True)
class Command:
    """One command; a mode write starts from these defaults. Units are the drive's: rev, s, N m."""

    mode: DriveMode = DriveMode.STOPPED
    position: float = 0.0
    """NaN leaves position alone."""
    velocity: float = 0.0
    feedforward: float = 0.0
    kp_scale: float = 1.0
    kd_scale: float = 1.0
    ilimit_scale: float = 1.0
    max_torque: float = 100.0
    timeout: float = 0.0
    """0 takes the configured default, NaN never times out."""
    ignore_bounds: float = 0.0


TORQUE_CONSTANT = 0.0275
"""Of the rotor, N m/A: 16 N m behind a gear of 6 take the 97 A that the board can give."""


class TorqueLaw:
    """The position controller of one drive and the limits behind it."""

    def __init__(self, settings: Settings) -> None:
        settings.follow(self._take)
        self.begin()
        self.notice = 0  # Limit that was at work in the last step, 0 if none

    def _take(self, settings: Settings) -> None:
        self._kp, self._kd = (settings[f"servo.pid_position.{gain}"] for gain in ("kp", "kd"))
        self._timeout_torque = settings["servo.timeout_max_torque_Nm"]
        self._max_velocity = settings["servo.max_velocity"]
        self._velocity_derate = settings["servo.max_velocity_derate"]
        self._amperes = settings["servo.max_current_A"]
        self._hot_amperes = settings["servo.derate_current_A"]
        self._margin = settings["servo.temperature_margin"]
        self._hot = settings["servo.fault_temperature"] - self._margin
        self._low, self._high = settings["servopos.position_min"], settings["servopos.position_max"]
        self._derate = settings["servo.position_derate"]
        self._ratio = settings["motor_position.rotor_to_output_ratio"]

    def begin(self) -> None:
        """Forget where the last mode was heading."""
        self.control_position = self.control_velocity = math.nan

    def position(self, command: Command, position: float, velocity: float, dt: float) -> float:
        """Return the torque of position mode, N m; see the firmware's ``ISR_DoPositionCommon``."""
        self._head_for(command, position, dt)
        torque = command.feedforward
        torque += self._kd * command.kd_scale * (self.control_velocity - velocity)
        torque += self._kp * command.kp_scale * (self.control_position - position)
        return self._within(torque, command.max_torque)

    def zero_velocity(self, kd_scale: float, velocity: float) -> float:
        """Return the torque of zero-velocity mode, N m."""
        return self._within(-self._kd * kd_scale * velocity, self._timeout_torque)

    def limited(
        self, torque: float, position: float, velocity: float, temperature: float, *, bounds: bool
    ) -> float:
        """Return the torque that the limits leave, N m; NaN passes, as in the firmware.

        Position, rev, and velocity, rev/s, are the output's as reported; the temperature, degrees
        C, is the output stage's; ``bounds`` tells whether the position limits hold.
        """
        if bounds:
            torque = self._in_bounds(torque, position)
        highest, amperes = self._max_velocity, self._amperes
        if abs(velocity) > highest and torque * velocity > 0:
            over = (abs(velocity) - highest) / self._velocity_derate
            torque = self._capped(torque, max(0.0, 1 - over) * amperes, Notice.MAX_VELOCITY)
        return self._cooled(torque, amperes, temperature)

    def _cooled(self, torque: float, amperes: float, temperature: float) -> float:
        hot = (temperature - self._hot) / self._margin
        if hot <= 0:
            return self._capped(torque, amperes, Notice.MAX_CURRENT)
        left = min(amperes, max(0.0, amperes + hot * (self._hot_amperes - amperes)))
        return self._capped(torque, left, Notice.FET_TEMPERATURE)

    def _in_bounds(self, torque: float, position: float) -> float:
        beyond = max(position - self._high, 0.0) if torque > 0 else max(self._low - position, 0.0)
        if not beyond > 0:
            return torque
        self.notice = Notice.POSITION_BOUNDS
        return torque * max(0.0, 1 - beyond / self._derate)

    def _capped(self, torque: float, amperes: float, notice: Notice) -> float:
        return self._within(torque, amperes * TORQUE_CONSTANT / self._ratio, notice)

    def _within(self, torque: float, most: float, notice: Notice = Notice.MAX_TORQUE) -> float:
        if abs(torque) > most:
            self.notice = notice
            return math.copysign(most, torque)
        return torque

    def _head_for(self, command: Command, position: float, dt: float) -> None:
        """Move the control position: at once where one is told, else with the velocity."""
        self.control_velocity = 0.0 if math.isnan(command.velocity) else command.velocity
        if math.isnan(self.control_position):
            self.control_position = position
        if math.isnan(command.position):
            self.control_position += self.control_velocity * dt
        else:
            self.control_position, command.position = command.position, math.nan
        if not math.isnan(self._high):
            self.control_position = min(self.control_position, self._high)
        if not math.isnan(self._low):
            self.control_position = max(self.control_position, self._low)


WITH_BOUNDS = (
    DriveMode.POSITION,
    DriveMode.ZERO_VELOCITY,
    DriveMode.TIMEOUT,
)
"""Modes in which the position limits take outward torque away."""
