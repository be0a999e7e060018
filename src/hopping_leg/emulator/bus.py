"""The CAN bus: what a drive makes of a frame, and what it answers.

Scales, saturation and NaN come from the client library, so both ends agree.
"""

import contextlib
import functools
import io
import itertools
from collections.abc import Sequence
from dataclasses import dataclass

from moteus import multiplex
from moteus.multiplex import FlowStreamSubframe, RegisterSubframe, StreamSubframe, SubframeType
from moteus.protocol import Register, Writer, scale_register

from hopping_leg.deploy import frames
from hopping_leg.emulator import diagnostic
from hopping_leg.emulator.drive import UNKNOWN_REGISTER, EmulatedDrive

_UUID_MASKS = range(Register.UUID_MASK1, Register.UUID_MASK4 + 1)
_WORDS_ONLY = range(Register.MODEL_NUMBER, Register.UUID_MASK_CAPABLE)
"""Registers that can be read as 32-bit integers only."""
_MOST = 256  # Subframes that are read: a few bytes may ask for millions of registers
_MAX_RUN = 3  # Registers whose count fits in the first byte of a subframe

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


@functools.lru_cache(maxsize=16)
def _parts(
    data: bytes,
) -> tuple[
    tuple[RegisterSubframe, ...],
    tuple[RegisterSubframe, ...],
    tuple[StreamSubframe | FlowStreamSubframe, ...],
]:
    """Return a payload's writes, reads and streams; a host often says the same again."""
    writes: list[RegisterSubframe] = []
    reads: list[RegisterSubframe] = []
    streams: list[StreamSubframe | FlowStreamSubframe] = []
    with contextlib.suppress(Exception):  # the parser raises whatever a short buffer leads to
        for s in itertools.islice(multiplex.parse_frame(data), _MOST):
            if isinstance(s, StreamSubframe | FlowStreamSubframe):
                streams.append(s)
            elif isinstance(s, RegisterSubframe) and s.type is SubframeType.WRITE:
                writes.append(s)
            elif isinstance(s, RegisterSubframe) and s.type is SubframeType.READ:
                reads.append(s)
    return tuple(writes), tuple(reads), tuple(streams)


@dataclass(frozen=True)
class Message:
    """A frame and what its payload says, up to the first subframe that makes no sense.

    Attributes:
        frame: From the host.
        writes, reads: Of registers.
        streams: Of and to consoles.
    """

    frame: frames.Frame
    writes: tuple[RegisterSubframe, ...]
    reads: tuple[RegisterSubframe, ...]
    streams: tuple[StreamSubframe | FlowStreamSubframe, ...]

    @staticmethod
    def read(frame: frames.Frame) -> "Message":
        """Return the message of a frame."""
        return Message(frame, *_parts(frame.data))

    def is_for(self, drive: EmulatedDrive) -> bool:
        """Whether it means a drive: by its id, and by its UUID or that's beginning where given."""
        return (
            self.frame.destination in (drive.id, frames.BROADCAST)
            and bool(self.writes or self.reads or self.streams)
            and all(
                s.value == drive.identity.get(s.register - Register.UUID_MASK1 + Register.UUID1)
                for s in self.writes
                if s.register in _UUID_MASKS
            )
        )


def act(message: Message, drive: EmulatedDrive, time: float) -> Errors:
    """Let a drive that is meant take what a message writes; return what it could not take."""
    errors = []
    for s in message.writes:
        assert s.value is not None
        if error := drive.write(s.register, s.resolution, s.value):
            errors.append((s.register, error))
    drive.commit(time)
    return errors


def answer(
    message: Message, drive: EmulatedDrive, time: float, errors: Errors
) -> frames.Frame | None:
    """Return the answer of a drive that is meant, with its failed writes; None if none is due."""
    reply = ReplyWriter()
    for register, code in errors:
        reply.error(register, code, reading=False)
    _stream(message, drive, reply, time)
    _read(message, drive, reply)
    return message.frame.reply(drive.id, reply.data) if message.frame.wants_reply else None


def _stream(message: Message, drive: EmulatedDrive, reply: ReplyWriter, time: float) -> None:
    for s in message.streams:
        if s.channel != diagnostic.CHANNEL:
            continue
        if s.type is SubframeType.STREAM_CLIENT_TO_SERVER:
            drive.diagnostic.write(s.data, time)
        elif isinstance(s, FlowStreamSubframe):
            packet, data = drive.diagnostic.poll_flow(s.packet_number, s.data[0])
            reply.stream(s.channel, data, packet)
        elif s.type is SubframeType.STREAM_CLIENT_POLL_SERVER:
            reply.stream(s.channel, drive.diagnostic.poll(s.data[0]))


def _read(message: Message, drive: EmulatedDrive, reply: ReplyWriter) -> None:
    """Answer reads in runs of consecutive registers of one resolution, as they were asked."""
    state = drive.state() if message.reads else {}
    run: list[float] = []
    first = resolution = 0
    for s in message.reads:
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
