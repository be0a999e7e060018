import pytest
from hypothesis import given
from hypothesis import strategies as st
from moteus.fdcanusb_device import _append_checksum, _compute_crc8

from hopping_leg.emulator.frames import Frame, LineProtocol, crc8, padded, received_line

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
    line = protocol.line(received_line(Frame(0x100, b"\x20")))
    assert line == _append_checksum(b"rcv 100 20 e B F") + b"\r\n"


@pytest.mark.parametrize("line", [b"hello", b"can send", b"can send xyz 00 bF", b"can send 1 0Z b"])
def test_nonsense_is_refused_and_forgotten(line):
    protocol = LineProtocol()
    (refusal,) = protocol.feed(line + b"\n")
    assert refusal.startswith(b"ERR")
    assert len(protocol.feed(SEND + b"\n")) == 2


def test_endless_noise_takes_no_memory():
    protocol = LineProtocol()
    for _ in range(50):
        protocol.feed(b"x" * 100)
    assert len(protocol._buffer) <= 512


def test_payloads_are_padded_with_nops():
    assert padded(b"\x01" * 9) == b"\x01" * 9 + b"\x50" * 3
    assert padded(b"\x01" * 8) == b"\x01" * 8
    assert len(padded(b"\x01" * 49)) == 64
