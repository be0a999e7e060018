"""The drive's text console, tunnelled in frames: ``tel stop``, ``conf ...``, ``d ...``."""

from collections.abc import Callable

from hopping_leg.emulator.rotor_encoder import RotorEncoder
from hopping_leg.emulator.settings import Settings
from hopping_leg.errors import UsageError

CHANNEL = 1
"""Stream channel of the console."""

_OK = b"OK\r\n"
_PACKETS = 256


class Diagnostic:
    """The console of one drive.

    The host writes lines and polls for the answers, with or without packet numbers.
    """

    def __init__(
        self, settings: Settings, encoder: RotorEncoder, stop: Callable[[float], None]
    ) -> None:
        self._settings, self._encoder, self._stop = settings, encoder, stop
        self._input = self._output = self._sent = b""
        self._packet = 0

    def write(self, data: bytes, time: float) -> None:
        """Take text from the host; complete lines are executed."""
        *lines, self._input = (self._input + data).replace(b"\r", b"\n").split(b"\n")
        for line in lines:
            words = line.decode("latin1").split()
            if words:
                try:
                    self._output += self._answer(words, time)
                except UsageError as error:
                    self._output += f"ERR {error}\r\n".encode()

    def poll(self, most: int) -> bytes:
        """Return the next bytes of the answers, at most so many."""
        piece, self._output = self._output[:most], self._output[most:]
        return piece

    def poll_flow(self, acknowledged: int, most: int) -> tuple[int, bytes]:
        """Return packet number and bytes: new ones if the last packet arrived, else it again."""
        if acknowledged in (self._packet, 0):
            self._packet = self._packet % (_PACKETS - 1) + 1
            self._sent = self.poll(most)
        return self._packet, self._sent

    def _answer(self, words: list[str], time: float) -> bytes:
        settings = self._settings
        match words:
            case ["tel", "stop"]:
                return _OK
            case ["conf", "get", name]:
                return f"{settings.text(name)}\r\n".encode()
            case ["conf", "set", name, value]:
                settings.set(name, value)
            case ["conf", "write"]:
                settings.save()
            case ["d", "stop"]:
                self._stop(time)
            case ["d", "nearest" | "rezero", *where]:
                self._encoder.set_nearest(float(where[0]) if where else 0.0)
            case ["d", "exact", where]:
                self._encoder.set_exact(float(where))
            case _:
                raise UsageError("unknown command")
        return _OK
