"""A pseudo-terminal that passes for an fdcanusb, plug included."""

import os
import termios
import tty
from pathlib import Path

from hopping_leg.emulator.frames import Frame
from hopping_leg.emulator.line_protocol import LineProtocol, received_line
from hopping_leg.emulator.reply_queue import QueuedReply


class PtyPort:
    """The adapter's end of a serial line.

    Args:
        link: Also offer the terminal under this path, which stays the same when it is plugged in
            again.
    """

    def __init__(self, link: Path | None = None) -> None:
        self._link = link
        self.plug_in()

    @property
    def path(self) -> Path:
        """What the host opens."""
        return self._link or self._terminal

    @property
    def plugged(self) -> bool:
        """Whether there is a terminal."""
        return self._master >= 0

    def plug_in(self) -> None:
        """Offer a new terminal."""
        self._master, self._slave = os.openpty()
        for descriptor in (self._master, self._slave):
            tty.setraw(descriptor, termios.TCSANOW)
        os.set_blocking(self._master, False)
        self._terminal = Path(os.ttyname(self._slave))
        self._protocol = LineProtocol()
        if self._link is not None:
            self._link.unlink(missing_ok=True)
            self._link.symlink_to(self._terminal)

    def unplug(self) -> None:
        """Take the terminal away; the host's reads and writes fail."""
        if self._link is not None:
            self._link.unlink(missing_ok=True)
        os.close(self._master)
        os.close(self._slave)
        self._master = self._slave = -1

    close = unplug

    def fileno(self) -> int:
        """Return the descriptor to wait for; -1 while unplugged."""
        return self._master

    def receive(self) -> list[Frame]:
        """Return frames that the host sent; lines that are none are answered."""
        try:
            items = self._protocol.feed(os.read(self._master, 65536))
        except BlockingIOError:
            return []
        frames = []
        for item in items:
            if isinstance(item, Frame):
                frames.append(item)
            else:
                self._write(item)
        return frames

    def send(self, item: QueuedReply) -> None:
        """Send what is due as a line."""
        if item.frame is None:
            self._write(item.noise + b"\r\n")
            return
        line = self._protocol.line(received_line(item.frame))
        if item.flip >= 0:
            line = _flipped(line, 2 * len(item.frame.data), item.flip)
        self._write(line)

    def _write(self, data: bytes) -> None:
        """Write; a host that does not read loses it."""
        try:
            os.write(self._master, data)
        except BlockingIOError:
            return


def _flipped(line: bytes, digits: int, flip: int) -> bytes:
    """Return a line with another digit in its payload: ``flip`` says which and how."""
    which, how = flip % digits, flip // digits % 15 + 1
    at = line.index(b" ", line.index(b" ") + 1) + 1 + which
    return line[:at] + b"%X" % (int(line[at : at + 1], 16) ^ how) + line[at + 1 :]
