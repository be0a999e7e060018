"""CAN frames as moteus uses them, and the text lines in which an fdcanusb speaks of them.

The host says ``can send ID DATA FLAGS`` and hears ``OK`` or ``ERR``, and ``rcv ID DATA FLAGS``. A
line may end in `` *XX``, the CRC-8 (polynomial 0x97) of all before the star.
"""

from dataclasses import dataclass

BROADCAST = 0x7F  # Destination that every drive listens to
REPLY_WANTED = 0x8000  # Bit of an arbitration id that asks for a reply

_SIZES = (*range(9), 12, 16, 20, 24, 32, 48, 64)


@dataclass(frozen=True, slots=True)
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
        """Id of the node that it is for."""
        return self.arbitration_id & BROADCAST

    @property
    def source(self) -> int:
        """Id of the node that sent it."""
        return (self.arbitration_id >> 8) & BROADCAST

    @property
    def wants_reply(self) -> bool:
        """Whether the drive shall answer."""
        return bool(self.arbitration_id & REPLY_WANTED)

    @property
    def extended(self) -> bool:
        """Whether the id needs 29 bits."""
        return self.arbitration_id > 0x7FF

    def answers(self, asked: "Frame") -> bool:
        """Whether it comes from the node that another was for, back to where that came from."""
        return self.arbitration_id == asked.destination << 8 | asked.source

    def reply(self, drive: int, data: bytes) -> "Frame":
        """Return the frame in which a drive answers this one."""
        prefix = self.arbitration_id & ~0xFFFF
        return Frame(prefix | (drive << 8) | self.source, padded(data))

    @staticmethod
    def parse(number: bytes, data: bytes) -> "Frame":
        """Return the frame of a line's second and third word; raises ValueError."""
        return Frame(int(number, 16), bytes.fromhex(data.decode()))

    @property
    def sent(self) -> bytes:
        """The line with which a host sends it, without its end."""
        return b"can send %04x %s BF" % (
            self.arbitration_id,
            padded(self.data).hex().upper().encode(),
        )

    @property
    def received(self) -> bytes:
        """The line that tells a host of it, without its end."""
        flags = "E B F" if self.extended else "e B F"
        return f"rcv {self.arbitration_id:x} {self.data.hex().upper()} {flags}".encode()


def padded(data: bytes) -> bytes:
    """Return the payload in the next size that CAN-FD knows, filled with NOPs."""
    size = next((s for s in _SIZES if s >= len(data)), len(data))
    return data + b"\x50" * (size - len(data))


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


def with_checksum(line: bytes) -> bytes:
    """Return a line with its checksum."""
    return b"%s *%02X" % (line, crc8(line + b" "))


def split_checksum(line: bytes) -> tuple[bytes, bool | None]:
    """Return a line without its checksum, and whether that is right; None if it has none."""
    content, star, claimed = line.rpartition(b"*")
    if not star or len(claimed) != 2:
        return line, None
    return content.rstrip(), claimed.upper() == b"%02X" % crc8(content)


class LineBuffer:
    """Cuts bytes into lines, however they arrive; endless noise takes no memory."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> list[bytes]:
        """Take bytes; return the lines that they complete, without ends and empty ones."""
        *lines, self._rest = (self._rest + data).replace(b"\r", b"\n").split(b"\n")
        if len(self._rest) > _LONGEST:
            self._rest = b""
        return [stripped for line in lines if (stripped := line.strip())]
