"""Registers: identity, how a value is packed at each resolution, and how reads are answered.

Scales, saturation and NaN come from the client's own writer, so both ends agree.
"""

import hashlib
import io
import struct
from collections.abc import Callable, Sequence

from moteus import multiplex
from moteus.protocol import Register, Writer

MODEL = 0x0000
"""Board r4."""
FIRMWARE = 0x010D
"""Firmware version in its binary-coded form."""
REGISTER_MAP = 5
"""Version of the register map that the client library speaks."""


def identity(seed: str) -> dict[int, int]:
    """Return the registers that tell what a drive was made with: versions, serial number, UUID.

    The seed makes serial number and UUID; two drives on a bus need different ones.
    """
    words = struct.unpack("<7I", hashlib.sha256(seed.encode()).digest()[:28])
    registers: dict[int, int] = {
        Register.MODEL_NUMBER: MODEL,
        Register.FIRMWARE_VERSION: FIRMWARE,
        Register.REGISTER_MAP_VERSION: REGISTER_MAP,
        Register.UUID_MASK_CAPABLE: 1,
    }
    numbers = [Register.SERIAL_NUMBER + k for k in range(3)]
    numbers += [Register.UUID1 + k for k in range(4)]
    return registers | {n: word & 0x7FFFFFFF for n, word in zip(numbers, words, strict=True)}


_MAX_RUN = 3
"""Registers whose count fits in the subframe's first byte."""

_INT_BITS = (8, 16, 32)
_Pack = Callable[[Writer, float, int], None]

_POSITIONS = (
    *(Register.POSITION, Register.ABS_POSITION, Register.COMMAND_POSITION),
    *(Register.COMMAND_STOP_POSITION, Register.CONTROL_POSITION, Register.POSITION_ERROR),
    *(Register.ENCODER_0_POSITION, Register.ENCODER_1_POSITION),
    *(Register.COMMAND_WITHIN_LOWER_BOUND, Register.COMMAND_WITHIN_UPPER_BOUND),
)
_VELOCITIES = (
    *(Register.VELOCITY, Register.COMMAND_VELOCITY, Register.COMMAND_VELOCITY_LIMIT),
    *(Register.CONTROL_VELOCITY, Register.VELOCITY_ERROR, Register.ENCODER_0_VELOCITY),
)
_TORQUES = (
    *(Register.TORQUE, Register.COMMAND_FEEDFORWARD_TORQUE, Register.COMMAND_POSITION_MAX_TORQUE),
    *(Register.POSITION_FEEDFORWARD, Register.POSITION_COMMAND, Register.CONTROL_TORQUE),
    Register.TORQUE_ERROR,
)
_CURRENTS = (Register.Q_CURRENT, Register.D_CURRENT, Register.COMMAND_FIXED_CURRENT_OVERRIDE)
_SHARES = (Register.COMMAND_KP_SCALE, Register.COMMAND_KD_SCALE, Register.COMMAND_ILIMIT_SCALE)
_VOLTAGES = (Register.VOLTAGE, Register.COMMAND_FIXED_VOLTAGE_OVERRIDE)
_TEMPERATURES = (Register.TEMPERATURE, Register.MOTOR_TEMPERATURE)

_PACKERS: dict[int, _Pack] = {
    **dict.fromkeys(_POSITIONS, Writer.write_position),
    **dict.fromkeys(_VELOCITIES, Writer.write_velocity),
    **dict.fromkeys(_TORQUES, Writer.write_torque),
    **dict.fromkeys(_CURRENTS, Writer.write_current),
    **dict.fromkeys(_SHARES, Writer.write_pwm),
    **dict.fromkeys(_VOLTAGES, Writer.write_voltage),
    **dict.fromkeys(_TEMPERATURES, Writer.write_temperature),
    Register.POWER: Writer.write_power,
    Register.COMMAND_ACCEL_LIMIT: Writer.write_accel,
    Register.COMMAND_TIMEOUT: Writer.write_time,
}
"""What packs each scaled register; all others are integers."""


class ReplyWriter:
    """Builds the payload that answers a frame's reads."""

    def __init__(self) -> None:
        self._buffer = io.BytesIO()
        self._writer = Writer(self._buffer)

    @property
    def data(self) -> bytes:
        """The payload so far."""
        return self._buffer.getvalue()

    def values(self, first: int, resolution: int, values: Sequence[float]) -> None:
        """Add a run of registers, all of one resolution: that of ``multiplex``."""
        head = multiplex.REPLY_BASE | (resolution << 2)
        short = len(values) <= _MAX_RUN
        self._buffer.write(bytes([head | len(values)] if short else [head, len(values)]))
        self._writer.write_varuint(first)
        for register, value in enumerate(values, first):
            if register in _PACKERS:
                _PACKERS[register](self._writer, value, resolution)
            elif resolution == multiplex.F32:
                self._writer.write_f32(value)
            else:  # as the firmware's cast to fewer bits leaves an integer
                half = 1 << (_INT_BITS[resolution] - 1)
                self._writer.write((int(value) + half) % (2 * half) - half, resolution)

    def error(self, register: int, code: int, *, reading: bool) -> None:
        """Add the report that a register could not be read or written."""
        kind = multiplex.READ_ERROR if reading else multiplex.WRITE_ERROR
        self._buffer.write(bytes([kind]))
        self._writer.write_varuint(register)
        self._writer.write_varuint(code)

    def stream(self, channel: int, data: bytes, packet: int | None = None) -> None:
        """Add a piece of the diagnostic stream, numbered where the host asked for that."""
        flow = packet is not None
        kind = multiplex.STREAM_SERVER_DATA_FLOW if flow else multiplex.STREAM_SERVER_DATA
        self._buffer.write(bytes([kind]))
        self._writer.write_varuint(channel)
        if packet is not None:
            self._buffer.write(bytes([packet]))
        self._writer.write_varuint(len(data))
        self._buffer.write(data)
