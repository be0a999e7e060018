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
from moteus.multiplex import RegisterSubframe, StreamSubframe, SubframeType
from moteus.protocol import Writer, scale_register

from hopping_leg.deploy import frames
from hopping_leg.emulator import settings
from hopping_leg.emulator.drive import EmulatedDrive

_MOST = 256  # Subframes that are read: a few bytes may ask for millions of registers
_UNKNOWN = 1  # Error code of a register that nobody knows
_MAX_RUN = 3  # Registers whose count fits in the first byte of a subframe


@functools.cache
def _scales(register: int) -> tuple[float, ...]:
    """Return what a count is worth at 8, 16 and 32 bits, as the client knows it; 1 in integers."""
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

    def unknown(self, register: int) -> None:
        """Add the report that a register is none that can be read."""
        self._buffer.write(bytes([multiplex.READ_ERROR]))
        self._writer.write_varuint(register)
        self._writer.write_varuint(_UNKNOWN)

    def stream(self, channel: int, data: bytes) -> None:
        """Add a piece of the diagnostic stream."""
        self._buffer.write(bytes([multiplex.STREAM_SERVER_DATA]))
        self._writer.write_varuint(channel)
        self._writer.write_varuint(len(data))
        self._buffer.write(data)


@dataclass(frozen=True)
class Message:
    """A frame and what its payload says, up to the first subframe that makes no sense.

    Attributes:
        frame: From the host.
        writes, reads: Of registers.
        streams: Of and to consoles.
    """

    frame: frames.Frame
    writes: list[RegisterSubframe]
    reads: list[RegisterSubframe]
    streams: list[StreamSubframe]

    @staticmethod
    @functools.lru_cache(maxsize=16)
    def read(frame: frames.Frame) -> "Message":
        """Return the message of a frame; a host often says the same again."""
        parts: list[object] = []
        with contextlib.suppress(Exception):  # the parser raises whatever a short buffer leads to
            parts.extend(itertools.islice(multiplex.parse_frame(frame.data), _MOST))
        registers = [part for part in parts if isinstance(part, RegisterSubframe)]
        return Message(
            frame,
            [part for part in registers if part.type is SubframeType.WRITE],
            [part for part in registers if part.type is SubframeType.READ],
            [part for part in parts if isinstance(part, StreamSubframe)],
        )

    def is_for(self, drive: EmulatedDrive) -> bool:
        """Whether it means a drive."""
        means = self.frame.destination in (drive.id, frames.BROADCAST)
        return means and bool(self.writes or self.reads or self.streams)


def act(message: Message, drive: EmulatedDrive, time: float) -> None:
    """Let a drive that is meant take what a message writes."""
    for s in message.writes:
        assert s.value is not None
        drive.write(s.register, s.resolution, s.value)
    drive.commit(time)


def answer(message: Message, drive: EmulatedDrive) -> frames.Frame | None:
    """Return the answer of a drive that is meant; None if none is due."""
    reply = ReplyWriter()
    for s in message.streams:
        if s.channel == settings.CHANNEL and s.type is SubframeType.STREAM_CLIENT_TO_SERVER:
            drive.console.write(s.data)
        elif s.channel == settings.CHANNEL and s.type is SubframeType.STREAM_CLIENT_POLL_SERVER:
            reply.stream(s.channel, drive.console.poll(s.data[0]))
    _read(message, drive, reply)
    return message.frame.reply(drive.id, reply.data) if message.frame.wants_reply else None


def _read(message: Message, drive: EmulatedDrive, reply: ReplyWriter) -> None:
    """Answer reads in runs of consecutive registers of one resolution, as they were asked."""
    state = drive.state() if message.reads else {}
    run: list[float] = []
    first = resolution = 0
    for s in message.reads:
        value = state.get(s.register)
        if value is None and s.resolution == multiplex.INT32:
            value = drive.identity.get(s.register)
        goes_on = run and s.register == first + len(run) and s.resolution == resolution
        if run and (value is None or not goes_on):
            reply.values(first, resolution, run)
            run = []
        if value is None:
            reply.unknown(s.register)
            continue
        if not run:
            first, resolution = s.register, s.resolution
        run.append(value)
    if run:
        reply.values(first, resolution, run)
