"""The CAN bus: what a drive makes of a frame, and what it answers."""

from moteus import multiplex
from moteus.multiplex import FlowStreamSubframe, RegisterSubframe, StreamSubframe, SubframeType
from moteus.protocol import Register

from hopping_leg.deploy.emulator.diagnostic import CHANNEL
from hopping_leg.deploy.emulator.drive import UNKNOWN_REGISTER, Drive
from hopping_leg.deploy.emulator.frames import BROADCAST, Frame
from hopping_leg.deploy.emulator.registers import ReplyWriter

_WORDS_ONLY = range(Register.MODEL_NUMBER, Register.UUID_MASK_CAPABLE)
"""Registers that can be read as 32-bit integers only."""


Errors = list[tuple[int, int]]
"""Register and error code of each write that failed."""


def act(frame: Frame, drive: Drive, time: float) -> Errors:
    """Let a drive take what a frame writes, if it is meant; return what it could not take."""
    subframes = _heard(frame, drive)
    errors = []
    for s in subframes:
        if isinstance(s, RegisterSubframe) and s.type is SubframeType.WRITE:
            assert s.value is not None
            error = drive.write(s.register, s.resolution, s.value)
            if error:
                errors.append((s.register, error))
    drive.commit(time)
    return errors


def answer(frame: Frame, drive: Drive, time: float, errors: Errors) -> Frame | None:
    """Return a drive's answer to a frame; None if it is not meant or none is wanted.

    Args:
        frame: From the host.
        drive: On the bus.
        time: Now, s.
        errors: Of its writes.
    """
    subframes = _heard(frame, drive)
    if not subframes:
        return None
    reply = ReplyWriter()
    for register, code in errors:
        reply.error(register, code, reading=False)
    _stream(subframes, drive, reply, time)
    _read(subframes, drive, reply)
    return frame.reply(drive.id, reply.data) if frame.wants_reply else None


def _heard(frame: Frame, drive: Drive) -> list[multiplex.Subframe]:
    """Return what a drive hears of a frame: nothing if another is meant."""
    if frame.destination not in (drive.id, BROADCAST):
        return []
    subframes = _parsed(frame.data)
    return subframes if _addressed(subframes, drive) else []


def _parsed(data: bytes) -> list[multiplex.Subframe]:
    """Return a payload's subframes up to the first that makes no sense."""
    subframes: list[multiplex.Subframe] = []
    parser = multiplex.parse_frame(data)
    try:
        subframes.extend(parser)
    except Exception:
        return subframes
    return subframes


def _addressed(subframes: list[multiplex.Subframe], drive: Drive) -> bool:
    """Whether a frame that names a UUID, or its beginning, means this drive."""
    for s in subframes:
        if (
            isinstance(s, RegisterSubframe)
            and s.type is SubframeType.WRITE
            and Register.UUID_MASK1 <= s.register <= Register.UUID_MASK4
        ):
            own = drive.identity.register(s.register - Register.UUID_MASK1 + Register.UUID1)
            if own != s.value:
                return False
    return True


def _stream(
    subframes: list[multiplex.Subframe], drive: Drive, reply: ReplyWriter, time: float
) -> None:
    for s in subframes:
        if not isinstance(s, StreamSubframe | FlowStreamSubframe) or s.channel != CHANNEL:
            continue
        if s.type is SubframeType.STREAM_CLIENT_TO_SERVER:
            drive.diagnostic.write(s.data, time)
        elif isinstance(s, FlowStreamSubframe):
            packet, data = drive.diagnostic.poll_flow(s.packet_number, s.data[0])
            reply.stream(s.channel, data, packet)
        elif s.type is SubframeType.STREAM_CLIENT_POLL_SERVER:
            reply.stream(s.channel, drive.diagnostic.poll(s.data[0]))


def _read(subframes: list[multiplex.Subframe], drive: Drive, reply: ReplyWriter) -> None:
    """Answer reads in runs of consecutive registers of one resolution, as they were asked."""
    run: list[float] = []
    first = resolution = 0
    for s in subframes:
        if not isinstance(s, RegisterSubframe) or s.type is not SubframeType.READ:
            continue
        value = drive.read(s.register)
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
