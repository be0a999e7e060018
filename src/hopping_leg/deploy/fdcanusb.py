"""Lines to and from an fdcanusb, read and written without ever waiting for it."""

import contextlib
import math
import os
import select
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import serial
from moteus.fdcanusb_device import FDCANUSB_IDS
from serial.tools import list_ports

from hopping_leg import locks
from hopping_leg.deploy.frames import Frame, LineBuffer, split_checksum, with_checksum
from hopping_leg.errors import HardwareError

_BAUD = 921_600  # Of a drive's own UART; an fdcanusb ignores it


def _wait_readable(descriptor: int, until: float) -> bool:
    patience = max(until - time.monotonic(), 0.0)
    return bool(select.select([descriptor], [], [], patience)[0])


class LineTransport:
    """Speaks to an fdcanusb over a descriptor that does not block.

    Lines carry checksums from the start, or once the adapter asks for them. ``wait`` tells whether
    a descriptor has something to read until a time.
    """

    def __init__(
        self,
        descriptor: int,
        *,
        checksums: bool,
        wait: Callable[[int, float], bool] = _wait_readable,
    ) -> None:
        self.trouble = ""
        self.gone = False  # Whether the adapter was pulled out
        self.checksums = checksums
        self._descriptor, self._wait = descriptor, wait
        self._lines, self._unsent = LineBuffer(), b""  # The latter is the end of a cut line

    def send(self, frames: Sequence[Frame]) -> None:
        """Write what the port takes at once; the rest is outdated, but for a line's end."""
        lines = [with_checksum(f.sent) if self.checksums else f.sent for f in frames]
        data = self._unsent + b"".join(line + b"\n" for line in lines)
        try:
            written = os.write(self._descriptor, data)
        except BlockingIOError:
            self.trouble = "The adapter took no commands for a time."
        except OSError as error:
            self._lose(str(error))
        else:
            self._unsent = data[written : data.index(b"\n", written - 1) + 1]

    def receive(self, until: float) -> list[Frame] | None:
        """Return the frames of what arrives next; lines that are none are skipped."""
        if self.gone or not self._wait(self._descriptor, until):
            return None
        try:
            data = os.read(self._descriptor, 65536)
        except OSError as error:
            self._lose(str(error))
            return None
        if not data:
            self._lose("The port was closed at its other end.")
        return [frame for line in self._lines.feed(data) for frame in self._read(line)]

    def close(self) -> None:
        """Close the descriptor."""
        os.close(self._descriptor)

    def _read(self, line: bytes) -> list[Frame]:
        """Return the frame of a line, if it is one."""
        content, right = split_checksum(line)
        if right is False or (right is None and self.checksums):
            return []
        if content.startswith(b"ERR"):
            self.trouble = content.decode("ascii", "replace")
            self.checksums |= b"checksum" in content
        try:
            kind, number, data, *_ = content.split()
            return [Frame.parse(number, data)] if kind == b"rcv" else []
        except ValueError:
            return []

    def _lose(self, why: str) -> None:
        self.gone, self.trouble = True, why


class Fdcanusb(LineTransport):
    """An fdcanusb, or a drive's UART, behind the serial port of a path.

    Without ``checksums`` given, all lines but those to a real fdcanusb have them, whose firmware
    may know none until it asks for them. HardwareError says that the port is in use or cannot be
    opened.
    """

    def __init__(self, path: str, checksums: bool | None = None) -> None:
        self._lock = locks.DeviceLock(Path(path), HardwareError)
        self._port = opened(self._lock.close, lambda: serial.Serial(path, _BAUD, timeout=0))
        device, ports = str(Path(path).resolve()), list_ports.comports()
        real = any(p.device == device and (p.vid, p.pid) in FDCANUSB_IDS for p in ports)
        wanted = not real if checksums is None else checksums
        super().__init__(self._port.fileno(), checksums=wanted)

    def close(self) -> None:
        """Close the port; another may be opened after it."""
        self._port.close()
        self._lock.close()


class SerialSensor:
    """A serial line whose lines begin with a number; HardwareError where it cannot be opened."""

    def __init__(self, path: str, baud: float) -> None:
        self._lock = locks.DeviceLock(Path(path), HardwareError)
        self._port = opened(self._lock.close, lambda: serial.Serial(path, int(baud), timeout=0))
        self._lines, self._count = LineBuffer(), 0

    def newest(self) -> float:
        """Return the newest number, NaN if no line has ended since the last call."""
        with contextlib.suppress(OSError, ValueError):  # nothing is there, or it is no number
            lines = self._lines.feed(os.read(self._port.fileno(), 65536))
            self._count += len(lines)
            if lines and self._count > 1:  # the first may have lost its beginning
                return float(lines[-1].split()[0])
        return math.nan

    def close(self) -> None:
        """Close the port."""
        self._port.close()
        self._lock.close()


def opened(give_back: Callable[[], None], make: Callable[[], Any]) -> Any:  # noqa: ANN401
    """Return what is made; where that fails, give the lock back, raise ``HardwareError``."""
    try:
        return make()
    except Exception as error:  # serial ports, python-can and the pi3hat raise many
        give_back()
        if isinstance(error, HardwareError):
            raise
        raise HardwareError(f"Cannot open the adapter: {error}.") from error
