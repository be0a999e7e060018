"""What a drive can be configured to, in RAM and in flash, and the text console that asks for it.

Defaults are those of firmware for the controller board r4 with what the qdd100 is delivered with;
only values that the emulator obeys are here.
"""

from hopping_leg.deploy.frames import LineBuffer
from hopping_leg.errors import UsageError, unknown_name

CHANNEL = 1  # Stream channel of the console

DEFAULTS: dict[str, int | float] = {
    "id.id": 1, "motor_position.output.offset": 0.0, "motor_position.output.sign": 1,
    "motor_position.rotor_to_output_ratio": 1 / 6, "servo.max_voltage": 46.0,
    "servo.fault_temperature": 75.0, "servo.position_derate": 0.02, "servo.pid_position.kp": 50.0,
    "servo.pid_position.kd": 1.0, "servo.default_timeout_s": 0.1,
    "servo.timeout_max_torque_Nm": 5.0, "servo.timeout_mode": 12, "servo.max_current_A": 100.0,
    "servopos.position_min": -0.01, "servopos.position_max": 0.01,
}  # fmt: skip
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


class Console:
    """A drive's console, tunnelled in frames: the host writes lines and polls for the answers."""

    def __init__(self, settings: Settings) -> None:
        self._settings, self._lines, self._output = settings, LineBuffer(), b""

    def write(self, data: bytes) -> None:
        """Take text from the host; complete lines are executed."""
        for line in self._lines.feed(data):
            try:
                answer = self._answer(line.decode("latin1").split())
            except UsageError as error:
                answer = f"ERR {error}"
            self._output += f"{answer}\r\n".encode()

    def poll(self, most: int) -> bytes:
        """Return the next bytes of the answers, at most so many."""
        piece, self._output = self._output[:most], self._output[most:]
        return piece

    def _answer(self, words: list[str]) -> str:
        match words:
            case ["tel", "stop"]:
                pass
            case ["conf", "get", name]:
                return self._settings.text(name)
            case ["conf", "set", name, value]:
                self._settings.set(name, value)
            case ["conf", "write"]:
                self._settings.save()
            case _:
                raise UsageError("unknown command")
        return "OK"
