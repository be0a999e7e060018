import moteus
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from moteus.fdcanusb_device import _append_checksum, _compute_crc8

from hopping_leg.deploy.frames import Frame, crc8
from hopping_leg.emulator.bus import ReplyWriter
from hopping_leg.emulator.ports import LineProtocol
from tests.emulator.bench import Bench, R


@pytest.fixture(scope="module")
def bench():
    return Bench()


@given(
    st.sampled_from((R.POSITION, R.VELOCITY, R.TORQUE, R.VOLTAGE, R.COMMAND_TIMEOUT)),
    st.sampled_from((moteus.INT8, moteus.INT16, moteus.INT32, moteus.F32)),
    st.floats(-1.2, 1.2),
)
def test_the_client_reads_what_was_written(register, resolution, value):
    for written in (value, float("nan")):
        reply = ReplyWriter()
        reply.values(register, resolution, [written])
        read = moteus.protocol.parse_reply(reply.data)[register]
        assert read == pytest.approx(written, abs=1.0, nan_ok=True)


def test_unknown_registers_are_errors_between_known_ones(bench):
    registers = {0x0E: moteus.F32, 0x0F: moteus.INT8, 0x1FF: moteus.INT8}
    (result,) = bench.cycle(bench.drives[0].make_custom_query(registers))
    parsed = moteus.protocol.parse_registers(result.data)
    assert set(parsed.response) == {0x0E, 0x0F}
    assert parsed.errors == [(0x1FF, 1)]


def test_identity_is_read_as_words(bench):
    assert bench.read(R.REGISTER_MAP_VERSION, resolution=moteus.INT32) == 5
    assert bench.read(R.FIRMWARE_VERSION, resolution=moteus.F32) is None
    serials = [bench.read(R.SERIAL_NUMBER1, drive=n, resolution=moteus.INT32) for n in (0, 1)]
    assert serials[0] != serials[1]


@given(st.binary(max_size=64))
@example(bytes([0x10, 0xFF, 0xFF, 0xFF, 0x7F, 0x00]))
@example(b"\x0d\x00\x00\x00\xc0\x7f\x0d\xb0\x02\x00\x00\x80\x7f")  # mode NaN, output at inf
def test_no_payload_breaks_a_drive(bench, data):
    bench.robot.receive(Frame(0x807F, data))
    bench.wait(5e-4)
    assert len(bench.robot.reply_queue.take(bench.robot.time)) <= 2
    assert np.isfinite(bench.robot.leg.q).all()


SEND = b"can send 8001 1100 bF"


@given(st.binary(max_size=80))
def test_the_crc_is_the_clients(data):
    assert crc8(data) == _compute_crc8(data)


def test_a_frame_is_acknowledged_before_it_is_delivered():
    ok, frame = LineProtocol().feed(SEND + b"\n")
    assert ok == b"OK\r\n"
    assert frame == Frame(0x8001, b"\x11\x00")
    assert (frame.destination, frame.source, frame.wants_reply) == (1, 0, True)


@given(st.lists(st.integers(1, 7), min_size=1, max_size=40))
def test_frames_do_not_depend_on_how_bytes_arrive(cuts):
    stream = b"\r\n".join([SEND, b"can send 0002 01000A Bf", b""])
    whole, pieces = LineProtocol().feed(stream), []
    protocol = LineProtocol()
    for cut in cuts:
        pieces += protocol.feed(stream[:cut])
        stream = stream[cut:]
    pieces += protocol.feed(stream)
    assert pieces == whole


def test_checksums_are_demanded_and_given_once_one_was_seen():
    protocol = LineProtocol()
    assert protocol.feed(SEND + b"\n")[0] == b"OK\r\n"
    ok, frame = protocol.feed(_append_checksum(SEND) + b"\n")
    assert ok == _append_checksum(b"OK") + b"\r\n"
    assert isinstance(frame, Frame)
    (refusal,) = protocol.feed(SEND + b"\n")
    assert refusal.startswith(b"ERR checksum")
    (refusal,) = protocol.feed(_append_checksum(SEND).replace(b"8001", b"8002") + b"\n")
    assert refusal.startswith(b"ERR checksum")
    line = protocol.line(Frame(0x100, b"\x20").received)
    assert line == _append_checksum(b"rcv 100 20 e B F") + b"\r\n"


@pytest.mark.parametrize("line", [b"hello", b"can send", b"can send xyz 00 bF", b"can send 1 0Z b"])
def test_nonsense_is_refused_and_forgotten(line):
    protocol = LineProtocol()
    (refusal,) = protocol.feed(line + b"\n")
    assert refusal.startswith(b"ERR")
    assert len(protocol.feed(SEND + b"\n")) == 2
