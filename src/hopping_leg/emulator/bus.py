"""The CAN bus: what a drive makes of a frame, and what it answers.

Scales, saturation and NaN come from the client library, so both ends agree.
"""

import contextlib
import functools
import io
from collections.abc import Sequence
from dataclasses import dataclass

from moteus import multiplex
from moteus.multiplex import FlowStreamSubframe, RegisterSubframe, StreamSubframe, SubframeType
from moteus.protocol import Register, Writer, scale_register

from hopping_leg.emulator import diagnostic, frames
from hopping_leg.emulator.drive import UNKNOWN_REGISTER, EmulatedDrive

_UUID_MASKS = range(Register.UUID_MASK1, Register.UUID_MASK4 + 1)
_WORDS_ONLY = range(Register.MODEL_NUMBER, Register.UUID_MASK_CAPABLE)
"""Registers that can be read as 32-bit integers only."""
_MAX_RUN = 3  # Registers whose count fits in the first byte of a subframe

Subframes = tuple[multiplex.Subframe, ...]
Errors = list[tuple[int, int]]
"""Register and error code of each write that failed."""


@functools.cache
def _scales(register: int) -> tuple[float, ...]:
    """Return what a count is worth at 8, 16 and 32 bits, as the client knows it; 1 in integers."""
    if register == Register.COMMAND_FIXED_CURRENT_OVERRIDE:  # of which the client knows nothing
        register = Register.Q_CURRENT
    resolutions = (multiplex.INT8, multiplex.INT16, multiplex.INT32)
    return tuple(float(scale_register(register, each, 1)) for each in resolutions)


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
            scales = _scales(register)
            if resolution == multiplex.F32:
                self._writer.write_f32(value)
            elif scales[-1] != 1:
                self._writer.write_mapped(value, *scales, resolution)
            else:  # as the firmware's cast to fewer bits leaves an integer
                half = 1 << ((8, 16, 32)[resolution] - 1)
                self._writer.write((int(value) + half) % (2 * half) - half, resolution)

    def error(self, register: int, code: int, *, reading: bool) -> None:
        """Add the report that a register could not be read or written."""
        kind = multiplex.READ_ERROR if reading else multiplex.WRITE_ERROR
        self._buffer.write(bytes([kind]))
        self._writer.write_varuint(register)
        self._writer.write_varuint(code)

    def stream(self, channel: int, data: bytes, packet: int | None = None) -> None:
        """Add a piece of the diagnostic stream, numbered where the host asked for that."""
        kind = multiplex.STREAM_SERVER_DATA if packet is None else multiplex.STREAM_SERVER_DATA_FLOW
        self._buffer.write(bytes([kind]))
        self._writer.write_varuint(channel)
        if packet is not None:
            self._buffer.write(bytes([packet]))
        self._writer.write_varuint(len(data))
        self._buffer.write(data)


@dataclass(frozen=True)
class Message:
    """A frame and what its payload says.

    Attributes:
        frame: From the host.
        subframes: Up to the first that makes no sense.
    """

    frame: frames.Frame
    subframes: Subframes

    @staticmethod
    def read(frame: frames.Frame) -> "Message":
        """Return the message of a frame."""
        subframes: list[multiplex.Subframe] = []
        with contextlib.suppress(Exception):  # the parser raises whatever a short buffer leads to
            subframes.extend(multiplex.parse_frame(frame.data))
        return Message(frame, tuple(subframes))

    def subframes_for(self, drive: EmulatedDrive) -> Subframes:
        """Return what is meant for a drive: nothing if another is addressed."""
        if self.frame.destination not in (drive.id, frames.BROADCAST):
            return ()
        return self.subframes if _addressed(self.subframes, drive) else ()


def act(message: Message, drive: EmulatedDrive, time: float) -> Errors:
    """Let a drive take what a message writes, if it is meant; return what it could not take."""
    errors = []
    for s in message.subframes_for(drive):
        if isinstance(s, RegisterSubframe) and s.type is SubframeType.WRITE:
            assert s.value is not None
            if error := drive.write(s.register, s.resolution, s.value):
                errors.append((s.register, error))
    drive.commit(time)
    return errors


def answer(
    message: Message, drive: EmulatedDrive, time: float, errors: Errors
) -> frames.Frame | None:
    """Return a drive's answer, which tells its failed writes; None if none is wanted of it."""
    subframes = message.subframes_for(drive)
    if not subframes:
        return None
    reply = ReplyWriter()
    for register, code in errors:
        reply.error(register, code, reading=False)
    _stream(subframes, drive, reply, time)
    _read(subframes, drive, reply)
    return message.frame.reply(drive.id, reply.data) if message.frame.wants_reply else None


def _addressed(subframes: Subframes, drive: EmulatedDrive) -> bool:
    """Whether a frame that names a UUID, or its beginning, means this drive."""
    return all(
        s.value == drive.identity.get(s.register - Register.UUID_MASK1 + Register.UUID1)
        for s in subframes
        if isinstance(s, RegisterSubframe) and s.type is SubframeType.WRITE
        if s.register in _UUID_MASKS
    )


def _stream(subframes: Subframes, drive: EmulatedDrive, reply: ReplyWriter, time: float) -> None:
    for s in subframes:
        if (
            not isinstance(s, StreamSubframe | FlowStreamSubframe)
            or s.channel != diagnostic.CHANNEL
        ):
            continue
        if s.type is SubframeType.STREAM_CLIENT_TO_SERVER:
            drive.diagnostic.write(s.data, time)
        elif isinstance(s, FlowStreamSubframe):
            packet, data = drive.diagnostic.poll_flow(s.packet_number, s.data[0])
            reply.stream(s.channel, data, packet)
        elif s.type is SubframeType.STREAM_CLIENT_POLL_SERVER:
            reply.stream(s.channel, drive.diagnostic.poll(s.data[0]))


def _read(subframes: Subframes, drive: EmulatedDrive, reply: ReplyWriter) -> None:
    """Answer reads in runs of consecutive registers of one resolution, as they were asked."""
    state = drive.state()
    run: list[float] = []
    first = resolution = 0
    for s in subframes:
        if not isinstance(s, RegisterSubframe) or s.type is not SubframeType.READ:
            continue
        value = state.get(s.register)
        if value is None:
            value = drive.stored(s.register)
        if s.register in _WORDS_ONLY and s.resolution != multiplex.INT32:
            value = None
        goes_on = run and s.register == first + len(run) and s.resolution == resolution
        if run and (value is None or not goes_on):
            reply.values(first, resolution, run)
            run = []
        if value is None:
            reply.error(s.register, UNKNOWN_REGISTER, reading=True)
            continue
        if not run:
            first, resolution = s.register, s.resolution
        run.append(value)
    if run:
        reply.values(first, resolution, run)
