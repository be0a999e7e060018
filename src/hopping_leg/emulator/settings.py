"""What a drive can be configured to: the values of its ``conf`` tree, in RAM and in flash.

Defaults are those of firmware for the controller board r4 with what the qdd100 is delivered with;
only values that the emulator obeys are here.
"""

from hopping_leg.errors import UsageError, unknown_name

DEFAULTS: dict[str, int | float] = {
    "id.id": 1,
    "motor_position.output.offset": 0.0,
    "motor_position.output.sign": 1,
    "motor_position.rotor_to_output_ratio": 1 / 6,
    "servo.max_voltage": 46.0,
    "servo.fault_temperature": 75.0,
    "servo.position_derate": 0.02,
    "servo.pid_position.kp": 50.0,
    "servo.pid_position.kd": 1.0,
    "servo.default_timeout_s": 0.1,
    "servo.timeout_max_torque_Nm": 5.0,
    "servo.timeout_mode": 12,
    "servo.max_current_A": 100.0,
    "servopos.position_min": -0.01,
    "servopos.position_max": 0.01,
}
"""Names as in ``conf get``."""


class Settings(dict[str, int | float]):
    """One drive's configuration; changes are lost with power unless saved.

    What is given differs from the defaults, already in flash. UsageError says that a name is
    unknown or a value has no meaning.
    """

    def __init__(self, **changes: float) -> None:
        super().__init__(DEFAULTS)
        for name, value in changes.items():
            self.set(name, str(value))
        self.save()

    def set(self, name: str, text: str) -> None:
        """Change a value in RAM; a ``UsageError`` tells of an unknown name or no number."""
        if name not in self:
            raise UsageError(unknown_name("drive setting", name, self))
        try:
            self[name] = type(DEFAULTS[name])(float(text))
        except (ValueError, OverflowError) as error:
            raise UsageError(f"'{text}' is no value for the drive setting '{name}'.") from error

    def text(self, name: str) -> str:
        """Return a value as the firmware prints it."""
        if name not in self:
            raise UsageError("error reading")
        value = self[name]
        return str(value) if isinstance(value, int) else f"{value:.6f}"

    def save(self) -> None:
        """Write RAM to flash."""
        self._saved = dict(self)

    def load(self) -> None:
        """Read flash to RAM, as after power was lost."""
        self.update(self._saved)
