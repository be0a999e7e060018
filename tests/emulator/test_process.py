import asyncio
import math
import time

import moteus
import numpy as np
import pytest
from moteus.fdcanusb_device import FdcanusbDevice
from studies.fault_campaign.emulator_process import EmulatorProcess

from hopping_leg.deploy.drive_link import LIMP, STOP
from hopping_leg.emulator.faults import Fault
from hopping_leg.emulator.ports import PtyPort
from hopping_leg.emulator.server import EmulatorConfig, Server
from hopping_leg.emulator.virtual_time import Lockstep
from hopping_leg.errors import UsageError

PATIENT = 1.0  # Watchdog of the tests, s: this machine may be busy

TORQUE = {"position": math.nan, "kp_scale": 0.0, "kd_scale": 0.0, "watchdog_timeout": PATIENT}


@pytest.fixture(scope="module")
def emulator():
    with EmulatorProcess(EmulatorConfig(pose="0.7,-1.4")) as running:
        yield running


def talk(emulator, conversation):
    """Run a conversation with the client library as it is installed."""

    async def run():
        device = FdcanusbDevice(str(emulator.path))
        transport = moteus.Transport([device])
        try:
            drives = [moteus.Controller(id=n, transport=transport) for n in (1, 2)]
            return await asyncio.wait_for(conversation(transport, drives), 20)
        finally:
            asyncio.get_running_loop().remove_reader(device._serial.fd)
            transport.close()

    return asyncio.run(run())


def test_the_client_drives_the_leg_with_checksums(emulator):
    async def push(transport, drives):
        frames = [
            drive.make_position(**TORQUE, feedforward_torque=torque, maximum_torque=5.0, query=True)
            for drive, torque in zip(drives, (0.3, -0.3), strict=True)
        ]
        seen = []
        for _ in range(20):
            seen.append([r.values for r in await transport.cycle(frames)])
            await asyncio.sleep(0.002)
        await transport.cycle([drive.make_stop() for drive in drives])
        return seen

    before = emulator.state()
    seen = talk(emulator, push)
    assert [values[moteus.Register.MODE] for values in seen[-1]] == [10, 10]
    torques = np.array([[values[moteus.Register.TORQUE] for values in pair] for pair in seen])
    np.testing.assert_allclose(np.median(torques[5:], axis=0), [0.3, -0.3], atol=0.06)
    time.sleep(0.1)
    after = emulator.state()
    assert after.time > before.time
    assert after.modes == (0, 0)
    assert after.q != before.q


def test_a_plug_comes_back_under_the_same_name(tmp_path):
    async def ask(transport, drives):
        return (await drives[0].query()).id

    link = tmp_path / "leg"
    with EmulatorProcess(EmulatorConfig(link=link)) as emulator:
        assert emulator.path == link
        assert talk(emulator, ask) == 1
        emulator.inject(Fault("unplug", duration=0.3))
        until = time.monotonic() + 10
        while link.exists() and time.monotonic() < until:
            time.sleep(0.01)
        assert not link.exists()
        while not link.exists() and time.monotonic() < until:
            time.sleep(0.01)
        assert talk(emulator, ask) == 1
        assert [fault.kind for _, fault in emulator.state().faults] == ["unplug"]
    assert not link.is_symlink()


def lockstep(checksums=True, **start):
    return Lockstep(EmulatorConfig(**start).build(), checksums=checksums)


def replies(run, ticks, outgoing=LIMP):
    """Return which drives answered in each tick."""
    seen = []
    for tick in range(ticks):
        now = run.wait_until(0.005 * (tick + 1))
        exchange = run.link.exchange(outgoing, now + 0.0035)
        seen.append(tuple(reply is not None for reply in exchange.replies))
    run.link.close()
    return seen


def test_waiting_takes_no_time_but_messages_do():
    run = lockstep()
    run.link.exchange(STOP, 0.0035)
    assert 0 < run.now() <= 0.002
    begun = time.monotonic()
    run.wait_until(20.0)
    assert run.now() == pytest.approx(20.0, abs=1e-3)
    assert run.link.ask(moteus.Controller(id=3).make_query(), 1.0) is None
    assert run.now() == pytest.approx(21.0, abs=1e-3)
    assert time.monotonic() - begun < 20.0
    run.link.close()


NOISE = (
    Fault("garbage_line", since="start", at=0.03),
    Fault("corrupt_reply", since="start", at=0.06, drive="hip"),
)


@pytest.mark.parametrize(
    ("checksums", "faults", "lost"),
    [
        (True, (Fault("drop_reply", since="start", at=0.05, drive="knee"),), [(True, False)]),
        (False, (Fault("drop_reply", since="start", at=0.05, count=2),), [(False, False)] * 2),
        (True, NOISE, [(False, True)]),
    ],
)
def test_every_tick_is_answered_but_by_drives_whose_reply_is_lost(checksums, faults, lost):
    seen = replies(lockstep(checksums, faults=faults), 30)
    assert [tick for tick in seen if tick != (True, True)] == lost


def test_a_link_has_one_emulator(tmp_path):
    link = tmp_path / "leg"
    first = PtyPort(link)
    with pytest.raises(UsageError, match="leg is in use by another process"):
        PtyPort(link)
    assert link.exists()
    first.close()
    PtyPort(link).close()


def test_a_computer_that_is_late_stops_the_leg_but_no_drives_clock():
    robot, port = EmulatorConfig().build(), PtyPort()
    server = Server(robot, port)
    server._offset -= 1.0
    server.turn()
    port.close()
    assert robot.time < 0.5
    assert robot.time + server.lost == pytest.approx(1.0, abs=0.4)
    for drive in robot.drives:
        assert drive.uptime == pytest.approx(robot.time + server.lost, abs=1e-3)
