"""Adapters alone: what the port does not take, what asks for checksums."""

import os
import time
import tty

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hopping_leg.deploy.fdcanusb import Fdcanusb
from hopping_leg.deploy.frames import Frame, LineBuffer, split_checksum, with_checksum
from hopping_leg.emulator.ports import LineProtocol
from hopping_leg.errors import HardwareError

WAIT = 2.0
"""Longest wait for replies, s: generous, as machines that run tests are slow."""


@pytest.fixture
def terminal():
    ends = os.openpty()
    for end in ends:
        tty.setraw(end)
    os.set_blocking(ends[0], False)
    yield ends
    for end in ends:
        os.close(end)


@given(st.integers(0, 2**29 - 1), st.binary(max_size=64))
def test_a_frame_survives_its_lines(number, data):
    frame = Frame(number, data + b"\x50" * (64 - len(data)))
    for line in (frame.sent, frame.received):
        content, right = split_checksum(with_checksum(line))
        assert (content, right) == (line, True)
        words = content.replace(b"can send", b"can_send").split()
        assert Frame.parse(words[1], words[2]) == frame


@given(st.binary(max_size=40))
def test_a_line_without_a_checksum_has_none(data):
    line = data.replace(b"*", b"")
    assert split_checksum(line) == (line, None)
    assert not any(b"\n" in line for line in LineBuffer().feed(data + b"\n"))


def test_the_adapter_reads_whole_lines_whatever_its_port_takes(terminal):
    master, slave = terminal
    adapter, port, asked = LineProtocol(), Fdcanusb(os.ttyname(slave), checksums=True), 0
    for size in (1, 2, 3):
        while not port.trouble:  # until the port takes no more
            port.send([Frame(0x8001, bytes([size] * 47))] * size)
        port.trouble, read = "", b""
        while size * 100 > len(read):
            read += os.read(master, 4096)
        items = adapter.feed(read)
        assert not [item for item in items if isinstance(item, bytes) and b"ERR" in item]
        asked += sum(isinstance(item, Frame) for item in items)
    assert asked > 50
    port.close()


def test_a_port_that_is_gone_is_refused_and_no_file_takes_its_place(tmp_path):
    with pytest.raises(HardwareError, match="Cannot open"):
        Fdcanusb(str(tmp_path / "gone"))
    assert not list(tmp_path.iterdir())


def test_an_adapter_that_asks_for_checksums_gets_them(terminal):
    master, slave = terminal
    adapter, port = LineProtocol(), Fdcanusb(os.ttyname(slave), checksums=False)
    adapter.checksums = True
    heard = []
    for _ in range(3):
        port.send([Frame(0x8001, b"\x11\x00")])
        for item in adapter.feed(os.read(master, 4096)):
            heard.append(item)
            line = item if isinstance(item, bytes) else adapter.line(item.reply(1, b"").received)
            os.write(master, line)
        port.receive(time.monotonic() + WAIT)
    assert [isinstance(item, Frame) for item in heard] == [False, False, True, False, True]
    assert port.trouble == "ERR checksum missing"
    with pytest.raises(HardwareError, match="in use by another process, or this one"):
        Fdcanusb(os.ttyname(slave))
    port.close()
