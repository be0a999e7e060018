"""CAN frames as moteus uses them, the queue of those for the host, and their text lines.

An fdcanusb speaks ``can send``, ``OK``, ``rcv``, ``ERR``. A line may end in `` *XX``, the CRC-8
(polynomial 0x97) of all before the star; once one arrived, all lines must have one.
"""

import heapq
import itertools
from dataclasses import dataclass
from typing import Generic, TypeVar

Item = TypeVar("Item")

BROADCAST = 0x7F
"""Destination that every drive listens to."""

_REPLY_WANTED = 0x8000
_SIZES = (*range(9), 12, 16, 20, 24, 32, 48, 64)


@dataclass(frozen=True)
class Frame:
    """One CAN-FD frame.

    Attributes:
        arbitration_id: Destination in bits 0-6, source in bits 8-14, 0x8000 asks for a reply.
        data: Payload, padded to a size that CAN-FD knows once it is on the wire.
    """

    arbitration_id: int
    data: bytes

    @property
    def destination(self) -> int:
        """Id of the drive that it is for."""
        return self.arbitration_id & BROADCAST

    @property
    def source(self) -> int:
        """Id of the node that sent it."""
        return (self.arbitration_id >> 8) & BROADCAST

    @property
    def wants_reply(self) -> bool:
        """Whether the drive shall answer."""
        return bool(self.arbitration_id & _REPLY_WANTED)

    @property
    def extended(self) -> bool:
        """Whether the id needs 29 bits."""
        return self.arbitration_id > 0x7FF

    def reply(self, drive: int, data: bytes) -> "Frame":
        """Return the frame in which a drive answers this one."""
        prefix = self.arbitration_id & ~0xFFFF
        return Frame(prefix | (drive << 8) | self.source, padded(data))


def padded(data: bytes) -> bytes:
    """Return the payload in the next size that CAN-FD knows, filled with NOPs."""
    size = next((s for s in _SIZES if s >= len(data)), len(data))
    return data + b"\x50" * (size - len(data))


@dataclass(frozen=True)
class QueuedReply:
    """One thing that arrives at the host."""

    frame: Frame | None = None
    """From a drive; None for noise."""
    noise: bytes = b""
    """A line that is no frame."""
    flip: int = -1
    """Which bits flip on a serial line, any number from 0; negative for none. A CAN controller
    discards such a frame."""


class TimedQueue(Generic[Item]):
    """Things in the order in which they are due; equal times keep their order."""

    def __init__(self) -> None:
        self._heap: list[tuple[float, int, Item]] = []
        self._numbers = itertools.count()

    def put(self, due: float, item: Item) -> None:
        """Add something that is due at a time, s."""
        heapq.heappush(self._heap, (due, next(self._numbers), item))

    def take(self, time: float) -> list[Item]:
        """Remove and return what is due at a time, s."""
        items = []
        while self._heap and self._heap[0][0] <= time:
            items.append(heapq.heappop(self._heap)[2])
        return items

    def next_due(self) -> float | None:
        """Return when the next thing is due, s; None if nothing waits."""
        return self._heap[0][0] if self._heap else None


_POLYNOMIAL = 0x97
_LONGEST = 512  # A longer line is noise: no frame needs more than 160 characters


def _divided(byte: int) -> int:
    for _ in range(8):
        byte = ((byte << 1) ^ _POLYNOMIAL) & 0xFF if byte & 0x80 else byte << 1
    return byte


_CRC_TABLE = bytes(map(_divided, range(256)))


def crc8(data: bytes) -> int:
    """Return the CRC-8 of an fdcanusb line."""
    crc = 0
    for byte in data:
        crc = _CRC_TABLE[crc ^ byte]
    return crc


def received_line(frame: Frame) -> bytes:
    """Return the line that tells the host of a frame, without its end."""
    flags = "E B F" if frame.extended else "e B F"
    return f"rcv {frame.arbitration_id:x} {frame.data.hex().upper()} {flags}".encode()


class LineProtocol:
    """The adapter's side of one connection."""

    def __init__(self) -> None:
        self._buffer = b""
        self.checksums = False  # Whether lines carry checksums: since the host sent one

    def feed(self, data: bytes) -> list[Frame | bytes]:
        """Take bytes from the host; return, in order, frames for the bus and answers to send.

        A frame's ``OK`` comes before the frame.
        """
        self._buffer += data
        *lines, self._buffer = self._buffer.replace(b"\r", b"\n").split(b"\n")
        if len(self._buffer) > _LONGEST:
            self._buffer = b""
        return [item for line in lines if line.strip() for item in self._take(line)]

    def line(self, text: bytes) -> bytes:
        """Return a line as sent to the host."""
        if self.checksums:
            text += b" *%02X" % crc8(text + b" ")
        return text + b"\r\n"

    def _take(self, line: bytes) -> list[Frame | bytes]:
        content, star, claimed = line.rpartition(b"*")
        if star and len(claimed) == 2:
            self.checksums = True
            if claimed.upper() != b"%02X" % crc8(content):
                return [self.line(b"ERR checksum mismatch")]
            line = content
        elif self.checksums:
            return [self.line(b"ERR checksum missing")]
        words = line.split()
        if words[:2] != [b"can", b"send"] or len(words) < 4:
            return [self.line(b"ERR unknown command")]
        try:
            frame = Frame(int(words[2], 16), bytes.fromhex(words[3].decode()))
        except ValueError:
            return [self.line(b"ERR malformed frame")]
        return [self.line(b"OK"), frame]
