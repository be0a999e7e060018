import math

from hypothesis import given
from hypothesis import strategies as st

from hopping_leg.deploy.drive_link import DriveMode, FaultCode
from hopping_leg.emulator.mode_machine import BETWEEN, STARTING_TIME, ModeMachine

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
    machine.command(DriveMode.POSITION, 0.0, timeout)
    time, _ = run(machine, STARTING_TIME + STEP)
    assert machine.mode is DriveMode.POSITION
    return machine, time


def test_starting_takes_its_time_and_steps():
    machine = ModeMachine()
    machine.command(DriveMode.POSITION, 0.0, math.nan)
    _, modes = run(machine, 0.02)
    steps = [DriveMode.ENABLING, DriveMode.CALIBRATING, DriveMode.POSITION]
    assert list(dict.fromkeys(modes)) == steps
    assert abs(modes.index(DriveMode.POSITION) * STEP - STARTING_TIME) <= STEP


def test_silence_leads_to_timeout_and_only_stop_leads_out():
    machine, time = powered(timeout=0.02)
    time, modes = run(machine, 0.03, time)
    assert modes[-1] is DriveMode.TIMEOUT
    machine.command(DriveMode.POSITION, time, 0.02)
    time, modes = run(machine, 0.05, time)
    assert set(modes) == {DriveMode.TIMEOUT}
    machine.command(DriveMode.STOPPED, time, 0.02)
    time, modes = run(machine, 0.01, time)
    assert modes[-1] is DriveMode.STOPPED
    machine.command(DriveMode.POSITION, time, 0.1)
    time, modes = run(machine, 0.02, time)
    assert modes[-1] is DriveMode.POSITION
    machine.command(DriveMode.BRAKE, time, 0.02)  # which no watchdog covers
    assert run(machine, 0.1, time)[1][-1] is DriveMode.BRAKE


@given(st.lists(st.sampled_from([m for m in DriveMode if m is not DriveMode.STOPPED]), max_size=8))
def test_fault_stays_until_stop_whatever_is_commanded(commands):
    machine, time = powered()
    machine.trip(FaultCode.MOTOR_DRIVER)
    for mode in commands:
        machine.command(mode, time, math.nan)
        time, modes = run(machine, 0.01, time)
        assert set(modes) == {DriveMode.FAULT}
        assert machine.fault == FaultCode.MOTOR_DRIVER
    machine.command(DriveMode.STOPPED, time, math.nan)
    run(machine, STEP, time)
    assert (machine.mode, machine.fault) == (DriveMode.STOPPED, 0)


def test_modes_in_between_cannot_be_commanded():
    machine, time = powered()
    for mode in BETWEEN:
        machine.command(mode, time, math.nan)
        assert run(machine, STEP, time)[1][-1] is DriveMode.POSITION
