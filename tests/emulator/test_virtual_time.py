import asyncio
import time

import moteus
import pytest

from hopping_leg.deploy.drive_link import LIMP, STOP
from hopping_leg.emulator.faults import Fault
from hopping_leg.emulator.server import EmulatorConfig
from hopping_leg.emulator.virtual_time import Lockstep
from hopping_leg.errors import HardwareError


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


def test_waiting_takes_no_time():
    run = lockstep()
    begun = time.monotonic()
    run.link.call(asyncio.sleep(20.0), 60.0)
    assert run.now() == pytest.approx(20.0, abs=1e-3)
    assert time.monotonic() - begun < 20.0
    with pytest.raises(HardwareError, match="did not answer"):
        run.link.call(asyncio.sleep(20.0), 1.0)
    assert run.now() == pytest.approx(21.0, abs=1e-3)
    run.link.close()


@pytest.mark.parametrize("checksums", [True, False])
def test_every_tick_is_answered_and_a_lost_reply_costs_one_drive_one_tick(checksums):
    fault = Fault("drop_reply", since="start", at=0.05, drive="knee")
    seen = replies(lockstep(checksums, faults=(fault,)), 30)
    assert seen.count((True, False)) == 1
    assert seen.count((True, True)) == 29


def test_noise_and_a_broken_line_cost_at_most_a_tick():
    faults = (
        Fault("garbage_line", since="start", at=0.03),
        Fault("corrupt_reply", since="start", at=0.06, drive="hip"),
    )
    seen = replies(lockstep(faults=faults), 30)
    assert seen.count((True, True)) >= 29


def test_the_client_lives_on_without_an_adapter():
    run = lockstep(faults=(Fault("unplug", since="start", at=0.05, duration=0.05),))
    seen = replies(run, 40)
    assert seen[5] == (True, True)
    assert set(seen[12:]) == {(False, False)}
    assert "Input/output error" in run.link.trouble


def test_a_run_is_exactly_repeatable():
    def heights():
        run = lockstep(robot="twin", seed=3)
        replies(run, 60)
        return run.truth

    assert heights() == heights()


def test_time_passes_on_the_wire():
    run = lockstep()
    before = run.now()
    run.link.exchange(STOP, before + 0.0035)
    assert 0 < run.now() - before <= 0.002
    assert run.link.controllers[0].transport.count() == 1
    assert isinstance(run.link.transport, moteus.Transport)
    run.link.close()
