"""What a drive can be configured to: the values of its ``conf`` tree, in RAM and in flash.

Defaults are those of firmware for the controller board r4 with what the qdd100 is delivered with;
only values that the emulator obeys are here.
"""

from __future__ import annotations

from collections.abc import Callable

from hopping_leg.errors import UsageError, unknown_name

DEFAULTS: dict[str, int | float] = {
    "id.id": 1,
    "motor_position.output.offset": 0.0,
    "motor_position.output.sign": 1,
    "motor_position.rotor_to_output_ratio": 1 / 6,
    "servo.max_voltage": 46.0,
    "servo.temperature_margin": 25.0,
    "servo.fault_temperature": 75.0,
    "servo.position_derate": 0.02,
    "servo.pid_position.kp": 50.0,
    "servo.pid_position.kd": 1.0,
    "servo.default_timeout_s": 0.1,
    "servo.timeout_max_torque_Nm": 5.0,
    "servo.timeout_mode": 12,
    "servo.max_current_A": 100.0,
    "servo.derate_current_A": -20.0,
    "servo.max_velocity": 500.0,
    "servo.max_velocity_derate": 2.0,
    "servopos.position_min": -0.01,
    "servopos.position_max": 0.01,
}
"""Names as in ``conf get``."""


class Settings:
    """One drive's configuration; changes are lost with power unless saved.

    What is given differs from the defaults, already in flash.

    Raises:
        UsageError: A name is unknown or a value has no meaning.
    """

    def __init__(self, **changes: float) -> None:
        self._followers: list[Callable[[Settings], None]] = []
        self._values = dict(DEFAULTS)
        for name, value in changes.items():
            self.set(name, str(value))
        self.save()

    def __getitem__(self, name: str) -> float:
        return float(self._values[name])

    def follow(self, take: Callable[[Settings], None]) -> None:
        """Let somebody who asks at every step take what he needs now and after every change."""
        self._followers.append(take)
        take(self)

    def _changed(self) -> None:
        for take in self._followers:
            take(self)

    def set(self, name: str, text: str) -> None:
        """Change a value in RAM; a ``UsageError`` tells of an unknown name or no number."""
        if name not in self._values:
            raise UsageError(unknown_name("drive setting", name, self._values))
        kind = type(DEFAULTS[name])
        try:
            self._values[name] = kind(float(text)) if kind is int else float(text)
        except ValueError as error:
            raise UsageError(f"'{text}' is no value for the drive setting '{name}'.") from error
        self._changed()

    def text(self, name: str) -> str:
        """Return a value as the firmware prints it."""
        if name not in self._values:
            raise UsageError("error reading")
        value = self._values[name]
        return str(value) if isinstance(value, int) else f"{value:.6f}"

    def save(self) -> None:
        """Write RAM to flash."""
        self._saved = dict(self._values)

    def load(self) -> None:
        """Read flash to RAM, as after power was lost."""
        self._values = dict(self._saved)
        self._changed()
