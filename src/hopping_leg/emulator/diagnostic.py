"""The drive's text console, tunnelled in frames: ``tel stop``, ``conf ...``, ``d ...``."""

from collections.abc import Callable

from hopping_leg.emulator.rotor_encoder import RotorEncoder
from hopping_leg.emulator.settings import Settings
from hopping_leg.errors import UsageError

CHANNEL = 1
"""Stream channel of the console."""

_OK = b"OK\r\n"


class Diagnostic:
    """The console of one drive: the host writes lines and polls for the answers."""

    def __init__(
        self, settings: Settings, encoder: RotorEncoder, stop: Callable[[float], None]
    ) -> None:
        self._settings, self._encoder, self._stop = settings, encoder, stop
        self._input = self._output = b""

    def write(self, data: bytes, time: float) -> None:
        """Take text from the host; complete lines are executed."""
        *lines, self._input = (self._input + data).replace(b"\r", b"\n").split(b"\n")
        for line in filter(None, map(bytes.split, lines)):
            try:
                self._output += self._answer([word.decode("latin1") for word in line], time)
            except (UsageError, ValueError) as error:
                self._output += f"ERR {error}\r\n".encode()

    def poll(self, most: int) -> bytes:
        """Return the next bytes of the answers, at most so many."""
        piece, self._output = self._output[:most], self._output[most:]
        return piece

    def _answer(self, words: list[str], time: float) -> bytes:
        settings = self._settings
        match words:
            case ["tel", "stop"]:
                pass
            case ["conf", "get", name]:
                return f"{settings.text(name)}\r\n".encode()
            case ["conf", "set", name, value]:
                settings.set(name, value)
            case ["conf", "write"]:
                settings.save()
            case ["d", "stop"]:
                self._stop(time)
            case ["d", "nearest", where]:
                self._encoder.set_nearest(float(where))
            case ["d", "exact", where]:
                self._encoder.set_exact(float(where))
            case _:
                raise UsageError("unknown command")
        return _OK
