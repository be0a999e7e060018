"""What a drive says about itself: model, firmware, serial number, UUID."""

import hashlib
import struct
from dataclasses import dataclass

from moteus.protocol import Register

MODEL = 0x0000
"""Board r4."""
FIRMWARE = 0x010D
"""Firmware version in its binary-coded form."""
REGISTER_MAP = 5
"""Version of the register map that the client library speaks."""


@dataclass(frozen=True)
class Identity:
    """Numbers that a drive was made with.

    Attributes:
        seed: Makes serial number and UUID; two drives on a bus need different ones.
        firmware: Version.
        register_map: Version; a drive with another one means something else by its registers.
    """

    seed: str
    firmware: int = FIRMWARE
    register_map: int = REGISTER_MAP

    @property
    def serial(self) -> tuple[int, int, int]:
        """Serial number, three positive 31-bit words."""
        a, b, c = struct.unpack("<3I", self._digest[:12])
        return a & 0x7FFFFFFF, b & 0x7FFFFFFF, c & 0x7FFFFFFF

    @property
    def uuid(self) -> bytes:
        """16 bytes."""
        return b"".join(struct.pack("<I", w & 0x7FFFFFFF) for w in self._words)

    @property
    def _words(self) -> tuple[int, ...]:
        return struct.unpack("<4I", self._digest[12:28])

    @property
    def _digest(self) -> bytes:
        return hashlib.sha256(self.seed.encode()).digest()

    def register(self, register: int) -> float | None:
        """Return an identity register, None if it is none."""
        values: dict[int, int] = {
            Register.MODEL_NUMBER: MODEL,
            Register.FIRMWARE_VERSION: self.firmware,
            Register.REGISTER_MAP_VERSION: self.register_map,
            Register.UUID_MASK_CAPABLE: 1,
        }
        values |= {Register.SERIAL_NUMBER + k: w for k, w in enumerate(self.serial)}
        values |= {Register.UUID1 + k: w for k, w in enumerate(struct.unpack("<4i", self.uuid))}
        return values.get(register)
