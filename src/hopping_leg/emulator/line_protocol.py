"""The text that an fdcanusb speaks: ``can send``, ``OK``, ``rcv``, ``ERR``, CRC-8 where asked for.

A line may end in `` *XX``, the CRC-8 (polynomial 0x97) of all before the star. Once one arrived,
all lines must have one and so have all answers.
"""

from hopping_leg.emulator.frames import Frame

_POLYNOMIAL = 0x97
_LONGEST = 512
"""A longer line is noise: no frame needs more than 160 characters."""


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
        self.checksums = False
        """Whether lines carry checksums: since the host sent one."""

    def feed(self, data: bytes) -> list[Frame | bytes]:
        """Take bytes from the host; return, in order, frames for the bus and answers to send.

        A frame's ``OK`` comes before the frame.
        """
        self._buffer += data
        *lines, self._buffer = self._buffer.replace(b"\r", b"\n").split(b"\n")
        if len(self._buffer) > _LONGEST:
            self._buffer = b""
        out: list[Frame | bytes] = []
        for line in lines:
            if line.strip():
                out += self._take(line)
        return out

    def line(self, text: bytes) -> bytes:
        """Return a line as sent to the host."""
        if self.checksums:
            text += b" "
            text += b"*%02X" % crc8(text)
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
