"""The adapter between host and drives: a serial line that passes for an fdcanusb's."""

import contextlib
import os
from abc import ABC, abstractmethod
from pathlib import Path

from hopping_leg import locks
from hopping_leg.deploy.frames import Frame, LineBuffer, split_checksum, with_checksum
from hopping_leg.emulator.reply_queue import QueuedReply
from hopping_leg.errors import UsageError


class LineProtocol:
    """The adapter's side of one connection; since the host sent a checksum, all lines have one."""

    def __init__(self) -> None:
        self._lines = LineBuffer()
        self.checksums = False

    def feed(self, data: bytes) -> list[Frame | bytes]:
        """Take bytes; return, in order, answers to the host and, behind their ``OK``, frames."""
        return [item for line in self._lines.feed(data) for item in self._take(line)]

    def line(self, text: bytes) -> bytes:
        """Return a line as sent to the host."""
        return (with_checksum(text) if self.checksums else text) + b"\r\n"

    def _take(self, line: bytes) -> list[Frame | bytes]:
        content, right = split_checksum(line)
        self.checksums |= right is not None
        if self.checksums and not right:
            missing = "missing" if right is None else "mismatch"
            return [self.line(f"ERR checksum {missing}".encode())]
        words = content.split()
        if words[:2] != [b"can", b"send"] or len(words) < 4:
            return [self.line(b"ERR unknown command")]
        try:
            return [self.line(b"OK"), Frame.parse(words[2], words[3])]
        except ValueError:
            return [self.line(b"ERR malformed frame")]


class LinePort(ABC):
    """The adapter's end of a serial line."""

    def __init__(self) -> None:
        self.sensor: LinePort | None = None  # A height sensor's own line
        self.plug_in()

    @property
    def plugged(self) -> bool:
        """Whether there is a line."""
        return self._descriptor >= 0

    @abstractmethod
    def plug_in(self) -> None:
        """Offer a new line; ``connect`` its end."""

    def connect(self, descriptor: int) -> None:
        """Begin anew on a descriptor that does not block."""
        self._descriptor, self._protocol = descriptor, LineProtocol()

    def unplug(self) -> None:
        """Take the line away; the host's reads and writes fail."""
        os.close(self._descriptor)
        self._descriptor = -1

    def close(self) -> None:
        """Take the line away for good."""
        if self.plugged:
            self.unplug()
        if self.sensor is not None:
            self.sensor.close()

    def fileno(self) -> int:
        """Return the descriptor to wait for; -1 while unplugged."""
        return self._descriptor

    def receive(self) -> list[Frame]:
        """Return frames that the host sent; lines that are none are answered."""
        try:
            items = self._protocol.feed(os.read(self._descriptor, 65536))
        except BlockingIOError:
            return []
        if answers := [item for item in items if not isinstance(item, Frame)]:
            self._write(b"".join(answers))
        return [item for item in items if isinstance(item, Frame)]

    def send(self, item: QueuedReply) -> None:
        """Send what is due as a line."""
        if item.frame is None:
            self._write(item.noise + b"\r\n")
            return
        line = self._protocol.line(item.frame.received)
        if item.flip >= 0:  # another digit in the payload: which and how
            digits = 2 * len(item.frame.data)
            at = line.index(b" ", line.index(b" ") + 1) + 1 + item.flip % digits
            other = int(line[at : at + 1], 16) ^ (item.flip // digits % 15 + 1)
            line = line[:at] + b"%X" % other + line[at + 1 :]
        self._write(line)

    def _write(self, data: bytes) -> None:
        with contextlib.suppress(BlockingIOError):  # a host that does not read loses it
            os.write(self._descriptor, data)


class PtyPort(LinePort):
    """A terminal that passes for an fdcanusb.

    It is also offered under the path ``link``, which outlives a pulled plug. UsageError says that
    another emulator has the link, or that it is a file of another kind.
    """

    def __init__(self, link: Path | None = None) -> None:
        self._link, self._lock = link, None
        if link is not None:
            self._lock = locks.named_lock(f"emulator-{link.absolute()}", str(link), UsageError)
            if link.exists() and not link.is_symlink():
                raise UsageError(f"{link} is there and no link to a terminal; give another --link.")
        super().__init__()

    def __str__(self) -> str:
        return str(self.path)

    @property
    def path(self) -> Path:
        """What the host opens."""
        return self._link or self._terminal

    def plug_in(self) -> None:
        """Offer a new terminal."""
        import tty  # POSIX alone has it

        master, self._slave = os.openpty()
        for descriptor in (master, self._slave):
            tty.setraw(descriptor)
        os.set_blocking(master, False)
        self._terminal = Path(os.ttyname(self._slave))
        self.connect(master)
        if self._link is not None:
            self._link.unlink(missing_ok=True)
            self._link.symlink_to(self._terminal)

    def unplug(self) -> None:
        """Take the terminal away."""
        if self._link is not None:
            self._link.unlink(missing_ok=True)
        super().unplug()
        os.close(self._slave)

    def close(self) -> None:
        """Take the terminal away for good."""
        super().close()
        if self._lock is not None:
            self._lock.release()
