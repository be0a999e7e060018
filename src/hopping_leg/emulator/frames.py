"""CAN frames as moteus uses them: who sends to whom, and what a reply must look like."""

from dataclasses import dataclass

BROADCAST = 0x7F
"""Destination that every drive listens to."""

_REPLY_WANTED = 0x8000
_STANDARD = 0x7FF
_SIZES = (*range(9), 12, 16, 20, 24, 32, 48, 64)
_PADDING = b"\x50"


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
        return self.arbitration_id > _STANDARD

    def reply(self, drive: int, data: bytes) -> "Frame":
        """Return the frame in which a drive answers this one."""
        prefix = self.arbitration_id & ~0xFFFF
        return Frame(prefix | (drive << 8) | self.source, padded(data))


def padded(data: bytes) -> bytes:
    """Return the payload in the next size that CAN-FD knows, filled with NOPs."""
    size = next((s for s in _SIZES if s >= len(data)), len(data))
    return data + _PADDING * (size - len(data))
