"""What goes wrong on a serial line, against a real terminal: never a hang."""

import contextlib
import math
import os
import pty
import threading
import time
import tty

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from hopping_leg.deploy import drive_info
from hopping_leg.deploy.drive_link import LIMP, STOP, joint_transforms
from hopping_leg.deploy.fdcanusb import Fdcanusb, SerialSensor
from hopping_leg.deploy.frames import Frame
from hopping_leg.deploy.moteus_link import MoteusLink
from hopping_leg.deploy.preflight import check_drives, require_fit
from hopping_leg.deploy.replies import SLACK, DriveClock, read_reply
from hopping_leg.deploy.safety_limits import hopping_limits
from hopping_leg.deploy.transport import open_transport
from hopping_leg.emulator.ports import LineProtocol
from hopping_leg.emulator.server import EmulatorConfig
from hopping_leg.errors import HardwareError
from hopping_leg.robot import load_robot

LEG = load_robot("legv2")
WAIT = 2.0
"""Longest wait for replies, s: generous, as machines that run tests are slow."""

MOST_BEHIND = 0.02
"""Most that the emulated leg catches up with at once, s."""


class Adapter:
    """An fdcanusb with two drives at the other end of a terminal.

    ``spoil(number, lines)`` may change the lines that answer the frame of that number.
    """

    def __init__(self):
        self.master, self.slave = os.openpty()
        for descriptor in (self.master, self.slave):
            tty.setraw(descriptor)
        self.path = os.ttyname(self.slave)
        self.robot = EmulatorConfig(robot="legv2").build()
        self.spoil = lambda number, lines: lines
        self.reading = threading.Event()
        self.reading.set()
        self.frames = 0
        self._begin = time.monotonic()
        self._protocol = LineProtocol()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def pull_out(self):
        os.close(self.slave)
        os.close(self.master)

    def say(self, line):
        os.write(self.master, line + b"\r\n")

    def _serve(self):
        while True:
            self.reading.wait()
            try:
                data = os.read(self.master, 4096)
            except OSError:
                return
            for item in self._protocol.feed(data):
                lines = [item] if isinstance(item, bytes) else self._answers(item)
                with contextlib.suppress(OSError):
                    os.write(self.master, b"".join(lines))

    def _answers(self, frame: Frame):
        behind = time.monotonic() - self._begin - self.robot.time
        if behind > MOST_BEHIND:  # on a slow machine the leg stands still, not the drives' clocks
            self.robot.stand_still(behind - MOST_BEHIND)
            self._begin += behind - MOST_BEHIND
        self.robot.advance(time.monotonic() - self._begin)
        self.robot.receive(frame)
        replies = [i.frame for i in self.robot.reply_queue.take(self.robot.time)]
        lines = [self._protocol.line(reply.received) for reply in replies]
        self.frames += 1
        return self.spoil(self.frames, lines)


@pytest.fixture
def adapter():
    return Adapter()


def exchange(link, outgoing=STOP, wait=WAIT):
    """Return an exchange of another tick; fail if it took much longer than it may."""
    time.sleep(0.005)
    start = time.monotonic()
    result = link.exchange(outgoing, start + wait)
    assert time.monotonic() - start < wait + 2.0
    return result


def whole(result):
    return None not in result.replies


def opened(adapter, *, checksums=True):
    """Return a link over which both drives have answered."""
    link = MoteusLink(LEG, Fdcanusb(adapter.path, checksums))
    assert whole(exchange(link))
    return link


@pytest.fixture(params=["like USB", "like UART"])
def link(adapter, request):
    """A link without the real adapter's safeguards, or with them."""
    link = opened(adapter, checksums=request.param == "like UART")
    yield link
    link.close()


def test_both_drives_answer_in_joint_units(link, adapter):
    result = exchange(link)
    assert [reply.mode for reply in result.replies] == [0, 0]
    for joint, reply in enumerate(result.replies):
        assert reply.position == pytest.approx(adapter.robot.leg.q[joint], abs=1e-3)


def test_a_lost_reply_costs_that_reply_and_nothing_else(link, adapter):
    adapter.spoil = lambda number, lines: [] if number == 4 else lines
    result = exchange(link, wait=0.5)
    assert [reply is None for reply in result.replies] == [False, True]
    for _ in range(3):
        assert whole(exchange(link))


def test_garbage_on_the_line_is_skipped_and_an_error_costs_one_tick_at_most(link, adapter):
    for line in (b"@#!%", b"rcv", b"rcv 100", b"rcv zz 2400 E", b"rcv 100 2 E", b"OK"):
        adapter.say(line)
        assert whole(exchange(link)), line
    adapter.say(b"ERR overrun")
    exchange(link)
    assert whole(exchange(link))


def test_endless_noise_costs_the_deadline_and_no_more(link, adapter):
    over = threading.Event()

    def flood():
        while not over.is_set():
            adapter.say(b"@" * 200)

    thread = threading.Thread(target=flood, daemon=True)
    adapter.spoil = lambda number, lines: []
    thread.start()
    for _ in range(3):
        assert exchange(link, wait=0.05).replies == (None, None)
    over.set()
    while thread.is_alive():
        exchange(link, wait=0.05)
    adapter.spoil = lambda number, lines: lines
    exchange(link)
    assert whole(exchange(link))


def test_a_late_reply_is_not_taken_for_a_fresh_one(link, adapter):
    held = []

    def hold(number, lines):
        if number == 4:
            held.extend(lines)
            return []
        return [*held, *lines] if number == 5 else lines

    adapter.spoil = hold
    before = exchange(link, wait=0.5)
    assert before.replies[1] is None
    time.sleep(0.1)
    asked = time.monotonic()
    result = exchange(link)
    assert [joint for joint, _ in result.late] == [1]
    assert result.late[0][1].taken < asked - 0.05
    assert all(reply.taken > asked - 0.05 for reply in result.replies if reply is not None)


def test_a_closed_port_opens_again_and_a_pulled_adapter_is_silence(adapter):
    link = opened(adapter)
    for _ in range(2):
        link.close()
        link = opened(adapter)
    adapter.pull_out()
    for _ in range(3):
        assert exchange(link, wait=0.05).replies == (None, None)
    assert link.transport.gone
    assert "Input/output error" in link.trouble
    link.close()
    opened(Adapter()).close()


def test_an_adapter_that_reads_nothing_blocks_no_one(adapter):
    link = opened(adapter)
    adapter.reading.clear()
    start = time.monotonic()
    for _ in range(50):
        exchange(link, LIMP, wait=0.005)
        link.send(LIMP)
    assert time.monotonic() - start < 20
    start = time.monotonic()
    adapter.pull_out()
    link.close()
    assert time.monotonic() - start < 10


def test_a_can_bus_without_drives_is_silence_and_named_so(monkeypatch):
    monkeypatch.setattr(drive_info, "_ANSWER_SECONDS", 0.05)
    link = MoteusLink(LEG, open_transport("virtual:empty"))
    for _ in range(3):
        assert exchange(link, wait=0.05).replies == (None, None)
    facts = drive_info.inspect(link)
    assert not any(drive.answers for drive in facts)
    with pytest.raises(HardwareError, match=r"id 1\) does not answer"):
        require_fit(check_drives(LEG, hopping_limits(LEG, 200.0), facts))
    link.close()


@given(st.binary(max_size=64))
@example(bytes([0x24, 0x04, 0x00, 0x10, 0xFF, 0xFF, 0xFF, 0x7F, 0x00]))
def test_no_damaged_reply_raises_or_takes_long(data):
    began = time.process_time()
    read_reply(data, joint_transforms(LEG)[0], DriveClock(), 1.0)
    assert time.process_time() - began < 0.1


def test_a_sensors_line_is_read_at_once_and_only_what_is_new_and_whole():
    ours, theirs = pty.openpty()
    sensor, nan = SerialSensor(os.ttyname(theirs), 115200), math.nan
    # the first line's beginning may be lost
    said = {b"345\n": nan, b"0.1 m\n0.2 m\n0.3": 0.2, b"": nan, b"5\n": 0.35, b"x\n": nan}
    for wrote, reads in said.items():
        os.write(ours, wrote)
        time.sleep(0.05)
        assert sensor.newest() == pytest.approx(reads, nan_ok=True)
    os.close(ours)
    assert math.isnan(sensor.newest()), "as it was pulled out"
    sensor.close()
    with pytest.raises(HardwareError, match="Cannot open /nowhere/line"):
        SerialSensor("/nowhere/line", 115200)


PERIOD = 0.005


def counter(time):
    return int(time * 1000)


@given(
    st.integers(0, 2**33),
    st.lists(st.floats(0.0002, 0.0034), min_size=30, max_size=60),
    st.floats(-1e-4, 1e-4),
)
def test_replies_in_time_are_fresh_and_dated_within_a_millisecond_or_so(boot, delays, drift):
    clock = DriveClock()
    for tick, delay in enumerate(delays):
        asked = 1000.0 + tick * PERIOD
        measured = asked + delay / 2
        shown = (boot + counter(measured * (1 + drift))) % 2**32
        taken = clock.date(shown, asked + delay)
        assert taken is not None
        assert taken >= asked - SLACK
        assert -0.0015 < taken - measured < 0.0035


@given(st.integers(1, 30), st.floats(0.0, 0.003))
def test_a_reply_to_an_earlier_question_is_never_fresh(late, into_the_tick):
    clock = DriveClock()
    for tick in range(40):
        clock.date(counter(1000.0 + tick * PERIOD), 1000.0 + tick * PERIOD + 0.0005)
    asked = 1000.0 + (40 + late) * PERIOD
    taken = clock.date(counter(1000.0 + 40 * PERIOD), asked + into_the_tick)
    assert taken < asked - SLACK
    assert taken == pytest.approx(1000.0 + 40 * PERIOD, abs=0.002)


def test_the_same_reply_again_is_nothing_but_a_drive_that_restarted_or_wrapped_is_heard():
    clock = DriveClock()
    assert clock.date(500_000, 10.0) == 10.0
    assert clock.date(500_000, 10.001) is None
    assert clock.date(3, 10.005) == 10.005
    wrapping = DriveClock()
    wrapping.date(2**32 - 2, 10.0)
    assert wrapping.date(3, 10.005) == pytest.approx(10.005)
    assert wrapping.date(2**32 - 1, 10.006) == pytest.approx(10.001)
