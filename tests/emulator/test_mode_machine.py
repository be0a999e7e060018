import math

from hypothesis import given
from hypothesis import strategies as st

from hopping_leg.emulator.moteus_codes import (
    BETWEEN,
    STARTING_TIME,
    FaultCode,
    ModeMachine,
    MoteusMode,
)

STEP = 5e-4


def run(machine, seconds, time=0.0):
    """Let time pass; return it and the modes on the way."""
    modes = []
    for _ in range(round(seconds / STEP)):
        machine.advance(time)
        modes.append(machine.mode)
        time += STEP
    return time, modes


def powered(timeout=math.nan):
    machine = ModeMachine()
    machine.command(MoteusMode.POSITION, 0.0, timeout)
    time, _ = run(machine, STARTING_TIME + STEP)
    assert machine.mode is MoteusMode.POSITION
    return machine, time


def test_starting_takes_its_time_and_steps():
    machine = ModeMachine()
    machine.command(MoteusMode.POSITION, 0.0, math.nan)
    _, modes = run(machine, 0.02)
    assert list(dict.fromkeys(modes)) == [
        MoteusMode.ENABLING,
        MoteusMode.CALIBRATING,
        MoteusMode.POSITION,
    ]
    assert abs(modes.index(MoteusMode.POSITION) * STEP - STARTING_TIME) <= STEP


def test_silence_leads_to_timeout_and_only_stop_leads_out():
    machine, time = powered(timeout=0.02)
    time, modes = run(machine, 0.03, time)
    assert modes[-1] is MoteusMode.TIMEOUT
    machine.command(MoteusMode.POSITION, time, 0.02)
    time, modes = run(machine, 0.05, time)
    assert set(modes) == {MoteusMode.TIMEOUT}
    machine.command(MoteusMode.STOPPED, time, 0.02)
    time, modes = run(machine, 0.01, time)
    assert modes[-1] is MoteusMode.STOPPED
    machine.command(MoteusMode.POSITION, time, 0.1)
    assert run(machine, 0.02, time)[1][-1] is MoteusMode.POSITION


def test_the_watchdog_covers_position_but_not_brake():
    machine, time = powered(timeout=0.02)
    machine.command(MoteusMode.BRAKE, time, 0.02)
    assert run(machine, 0.1, time)[1][-1] is MoteusMode.BRAKE


@given(
    st.lists(st.sampled_from([m for m in MoteusMode if m is not MoteusMode.STOPPED]), max_size=8)
)
def test_fault_stays_until_stop_whatever_is_commanded(commands):
    machine, time = powered()
    machine.trip(FaultCode.MOTOR_DRIVER)
    for mode in commands:
        machine.command(mode, time, math.nan)
        time, modes = run(machine, 0.01, time)
        assert set(modes) == {MoteusMode.FAULT}
        assert machine.fault == FaultCode.MOTOR_DRIVER
    machine.command(MoteusMode.STOPPED, time, math.nan)
    run(machine, STEP, time)
    assert (machine.mode, machine.fault) == (MoteusMode.STOPPED, 0)


def test_modes_in_between_cannot_be_commanded():
    machine, time = powered()
    for mode in BETWEEN:
        machine.command(mode, time, math.nan)
        assert run(machine, STEP, time)[1][-1] is MoteusMode.POSITION


def test_position_mode_does_not_begin_outside_its_limits():
    machine = ModeMachine()
    machine.command(MoteusMode.POSITION, 0.0, math.nan)
    for n in range(40):
        machine.advance(n * STEP, outside_limits=True)
    assert (machine.mode, machine.fault) == (MoteusMode.FAULT, FaultCode.START_OUTSIDE_LIMIT)
