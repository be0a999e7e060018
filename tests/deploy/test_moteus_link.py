"""What goes wrong on the way to the drives: never a hang, and nothing old is taken for new."""

import math
import os
import pty
import threading
import time

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from hopping_leg.deploy import drive_info
from hopping_leg.deploy.drive_link import LIMP, STOP, joint_transforms
from hopping_leg.deploy.fdcanusb import Fdcanusb, SerialSensor
from hopping_leg.deploy.moteus_link import MoteusLink
from hopping_leg.deploy.preflight import check_drives, require_fit
from hopping_leg.deploy.replies import SLACK, DriveClock, read_reply
from hopping_leg.deploy.safety_limits import hopping_limits
from hopping_leg.deploy.transport import open_transport
from hopping_leg.emulator.faults import Fault
from hopping_leg.emulator.server import EmulatorConfig
from hopping_leg.emulator.virtual_time import Lockstep
from hopping_leg.errors import HardwareError
from hopping_leg.robot import load_robot

LEG = load_robot("legv2")
PERIOD = 0.005


def emulated(*faults, checksums=True):
    return Lockstep(EmulatorConfig(robot="legv2", faults=faults).build(), checksums=checksums)


def tick(run):
    """Return the exchange of another tick in virtual time."""
    now = run.wait_until(run.now() + PERIOD)
    return run.link.exchange(STOP, now + 0.7 * PERIOD)


@pytest.mark.parametrize("checksums", [True, False])
def test_both_drives_answer_in_joint_units_whatever_else_is_on_the_line(checksums):
    run = emulated(checksums=checksums)
    for line in (b"", b"@#!%", b"rcv", b"rcv 100", b"rcv zz 2400 E", b"rcv 100 2 E", b"OK"):
        run._port._write(line + b"\r\n")
        replies = tick(run).replies
        assert [reply.mode for reply in replies] == [0, 0], line
        assert [reply.position for reply in replies] == pytest.approx(run.robot.leg.q, abs=1e-3)
    run._port._write(b"ERR overrun\r\n")
    tick(run)
    assert None not in tick(run).replies
    assert run.link.trouble == ("" if checksums else "ERR overrun")
    run.link.close()


def test_a_late_reply_is_not_taken_for_a_fresh_one():
    run = emulated(Fault("late_reply", since="start", at=0.1, value=0.008, drive="knee"))
    asked, found = [], []
    for _ in range(40):
        asked.append(run.now() + PERIOD)
        found.append(tick(run))
    (missing,) = (k for k, exchange in enumerate(found) if None in exchange.replies)
    assert found[missing].replies[0] is not None
    ((joint, late),) = (pair for exchange in found for pair in exchange.late)
    assert joint == 1
    assert abs(late.taken - asked[missing]) < 0.002
    run.link.close()


@pytest.fixture
def port():
    """A terminal at whose other end nobody listens: its end there, and a link through it."""
    ours, theirs = pty.openpty()
    os.set_blocking(ours, False)
    return ours, os.ttyname(theirs), theirs


def hears_nothing(link, wait=0.05):
    began = time.monotonic()
    assert link.exchange(LIMP, began + wait).replies == (None, None)
    assert time.monotonic() - began < wait + 2.0


def test_endless_noise_costs_the_deadline_and_no_more(port):
    ours, path, _ = port
    link, over = MoteusLink(LEG, Fdcanusb(path)), threading.Event()

    def flood():
        os.set_blocking(ours, True)
        while not over.is_set():
            os.write(ours, b"@" * 200)

    thread = threading.Thread(target=flood, daemon=True)
    thread.start()
    for _ in range(3):
        hears_nothing(link)
    over.set()
    while thread.is_alive():
        hears_nothing(link)
    link.close()


def test_a_closed_port_opens_again_and_a_pulled_adapter_is_silence(port):
    ours, path, theirs = port
    for _ in range(2):
        MoteusLink(LEG, Fdcanusb(path)).close()
    link = MoteusLink(LEG, Fdcanusb(path))
    for end in (theirs, ours):
        os.close(end)
    for _ in range(3):
        hears_nothing(link)
    assert link.transport.gone
    assert "Input/output error" in link.trouble
    link.close()


def test_an_adapter_that_reads_nothing_blocks_no_one(port):
    link, start = MoteusLink(LEG, Fdcanusb(port[1])), time.monotonic()
    for _ in range(50):
        hears_nothing(link, wait=0.005)
        link.send(LIMP)
    link.close()
    assert time.monotonic() - start < 20


def test_a_can_bus_without_drives_is_silence_and_named_so(monkeypatch):
    monkeypatch.setattr(drive_info, "_ANSWER_SECONDS", 0.05)
    link = MoteusLink(LEG, open_transport("virtual:empty"))
    hears_nothing(link)
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
    assert [clock.date(500_000, arrived) for arrived in (10.0, 10.001)] == [10.0, None]
    assert clock.date(3, 10.004, follows=True) < 0, "a reply of a drive that did not restart is old"
    assert clock.date(3, 10.005) == 10.005
    wrapping, told = DriveClock(), [(2**32 - 2, 10.0), (3, 10.005), (2**32 - 1, 10.006)]
    assert [wrapping.date(*one) for one in told] == pytest.approx([10.0, 10.005, 10.001])
