"""The drive's text console, tunnelled in frames: ``tel stop``, ``conf ...``."""

from hopping_leg.emulator.settings import Settings
from hopping_leg.errors import UsageError

CHANNEL = 1  # Stream channel of the console


class Console:
    """The console of one drive: the host writes lines and polls for the answers."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._input = self._output = b""

    def write(self, data: bytes) -> None:
        """Take text from the host; complete lines are executed."""
        *lines, self._input = (self._input + data).replace(b"\r", b"\n").split(b"\n")
        for line in filter(None, map(bytes.split, lines)):
            try:
                answer = self._answer([word.decode("latin1") for word in line])
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
