"""Adapters alone: what the port does not take, what asks for checksums, a pi3hat's buses."""

import asyncio
import os
import time
import tty
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import moteus
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hopping_leg.deploy.fdcanusb import Fdcanusb
from hopping_leg.deploy.frames import REPLY_WANTED as ASKED
from hopping_leg.deploy.frames import Frame, LineBuffer, split_checksum, with_checksum
from hopping_leg.deploy.transport import Pi3Hat
from hopping_leg.emulator.faults import Fault
from hopping_leg.emulator.ports import LineProtocol
from hopping_leg.errors import HardwareError
from tests.emulator.bench import Bench

WAIT = 2.0  # Longest wait for replies, s: generous, as machines that run tests are slow


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


class Hat:
    """A pi3hat as its library shows it, with a bench's drives, one by default on each bus."""

    def __init__(self, robot, *ids):
        self.robot, self.sent, self.heard, self.close = robot, [], [], lambda: None
        said = {"parent": lambda: self, "empty_bus_tx_safe": lambda: True}
        self.buses = [SimpleNamespace(ids=n, **said) for n in ids or ((), (1,), (2,))]

    async def transaction(self, requests):
        for bus, frame in ((r.child_device, r.frame) for r in requests):
            self.sent.append(bus)
            frame = Frame(frame.arbitration_id, frame.data)
            if frame.destination in bus.ids:
                self.robot.receive(frame)
                replies = [item.frame for item in self.robot.reply_queue.take(self.robot.time)]
                self.heard += [moteus.Frame(r.arbitration_id, r.data, channel=bus) for r in replies]

    async def receive_frame(self):
        while not self.heard:
            await asyncio.sleep(1e-3)
        return self.heard.pop(0)


def answering(port, *drives, seconds=WAIT):
    """Ask drives for their modes at once; return which answer."""
    port.send([Frame(ASKED | drive, b"\x11\x00") for drive in drives])
    until = time.monotonic() + seconds
    return [frame.source for _ in drives for frame in port.receive(until) or ()]


def test_a_pi3hat_finds_each_drives_bus_and_waits_no_longer_than_it_may():
    bench = Bench(faults=[Fault("drop_reply", drive="knee", since="start", at=0.1)])
    hat = Hat(bench.robot)
    port = Pi3Hat(lambda: hat.buses)
    assert answering(port, 1) + answering(port, 2) == [1, 2]
    assert hat.sent == [*hat.buses, *hat.buses]
    assert answering(port, 1, 2) == [1, 2]
    port.send([Frame(2, b"\x01\x00\x00")])
    assert hat.sent[6:] == [*hat.buses[1:], hat.buses[2]]
    bench.wait(0.101)
    began = time.monotonic()
    assert answering(port, 1, 2, seconds=0.02) == [1]
    assert port.receive(0.0) is None
    assert 0.02 <= time.monotonic() - began < WAIT
    with pytest.raises(HardwareError, match="pi3hat is in use"):
        Pi3Hat(lambda: hat.buses)
    assert not port.trouble
    port.close()


def test_braking_waits_neither_for_the_search_of_a_drive_nor_for_a_hat_that_hangs(monkeypatch):
    monkeypatch.setattr("hopping_leg.deploy.transport._TURN_SECONDS", 1.0)
    hat = Hat(Bench().robot)
    port, brake = Pi3Hat(lambda: hat.buses), [Frame(3, b"\x01\x00\x0f")]
    search = ThreadPoolExecutor().submit(answering, port, 3, seconds=60)
    while len(hat.sent) < 3 or not port._turn.locked():
        time.sleep(1e-3)
    port.send(brake)
    assert hat.sent == [*hat.buses, *hat.buses]
    assert search.result() == []
    port._turn.acquire()
    port.send(brake)
    assert "hangs" in port.trouble
    port.close()
    Pi3Hat(lambda: hat.buses).close()
    port._runner.close()


def test_a_pi3hat_with_two_drives_of_one_id_is_refused():
    port = Pi3Hat(lambda: Hat(Bench().robot, (1,), (1, 2)).buses)
    with pytest.raises(HardwareError, match="drives of id 1"):
        answering(port, 1) + answering(port, 1)
    port._hat.close = None
    with pytest.raises(TypeError):
        port.close()
    Pi3Hat(lambda: Hat(None).buses).close()
