import math

import moteus
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hopping_leg.deploy.drive_link import DriveMode, FaultCode
from hopping_leg.emulator.mode_machine import STARTING_TIME, ModeMachine, Notice
from tests.emulator.bench import Bench, R


@pytest.fixture
def bench():
    """A leg that nobody holds, its drives not yet powered."""
    return Bench(held=False)


@pytest.fixture
def powered(bench):
    bench.power()
    return bench


def spin(bench, torque, seconds=0.04):
    """Spin the hip in the air; return its speed, rev/s."""
    bench.robot.leg._legs.place(slice(None), 1.0, np.array([0.0, -1.5]))
    bench.push(torque, seconds=seconds)
    return bench.read(R.VELOCITY)


def configure(bench, **settings):
    for drive in bench.robot.drives:
        for name, value in settings.items():
            drive.settings.set(name.replace("__", "."), str(value))


def limits(bench, low, high):
    configure(bench, servopos__position_min=low, servopos__position_max=high)


def test_torque_appears_at_the_joint_behind_the_belt(powered):
    powered.push(0.4, -0.2, seconds=5e-4)
    legs = powered.robot.leg._legs
    np.testing.assert_allclose(legs.measured_torque[0], [0.4, -0.4], atol=1e-6)
    told = [reply.values[R.TORQUE] for reply in powered.torque(0.4, -0.2)]
    assert told == pytest.approx([0.4, -0.2])


def test_a_person_holds_the_leg_until_both_drives_are_powered():
    bench = Bench()
    before = bench.robot.leg.q
    bench.wait(0.3)
    assert (bench.robot.leg.q == before).all()
    bench.power()
    bench.wait(0.3)
    assert np.abs(bench.robot.leg.q - before).max() > 0.1


def test_a_leg_that_lies_is_brought_back_once_its_drives_are_off_and_nobody_speaks():
    bench = Bench()
    before, bench.robot.patience = bench.robot.leg.q, 1.0
    bench.power()
    bench.wait(0.9)
    bench.cycle(*(drive.make_stop() for drive in bench.drives))
    bench.wait(0.9)
    assert not bench.robot.held
    assert np.abs(bench.robot.leg.q - before).max() > 0.1
    bench.wait(1.0)
    wires = enumerate(bench.robot.leg.transforms)
    told = [wire.joint_position(bench.read(R.POSITION, drive=n)) for n, wire in wires]
    assert told == pytest.approx(before, abs=1e-3), "the drives counted their turns on the way"


@pytest.mark.parametrize(("mode", "least", "most"), [(12, 0.9, 1.01), (15, 0.0, 0.5)])
def test_after_silence_a_drive_in_torque_mode_is_limp_unless_it_shall_brake(
    bench, mode, least, most
):
    limits(bench, math.nan, math.nan)
    configure(bench, servo__timeout_mode=mode)
    bench.power()
    spin(bench, 0.6)
    bench.push(0.0, seconds=0.0205, watchdog=0.02)
    assert bench.modes() == [11, 11]
    begin = bench.read(R.VELOCITY)
    bench.wait(0.02)
    assert least <= bench.read(R.VELOCITY) / begin <= most


def test_nan_torque_keeps_the_drive_active_with_a_notice(powered):
    for _ in range(5):
        powered.push(math.nan, seconds=0.005)
    assert powered.modes() == [10, 10]
    assert powered.faults()[0] == Notice.MAX_VOLTAGE
    assert np.isfinite(powered.robot.leg.q).all()


def test_position_limits_take_outward_torque_only_and_the_joint_coasts_on(bench):
    limits(bench, -1.0, 0.2)
    bench.power()
    spin(bench, 3.0, 0.1)
    position, speed = bench.read(R.POSITION, R.VELOCITY)
    assert position > 0.22
    assert speed > 0.5
    assert bench.faults()[0] == Notice.POSITION_BOUNDS
    assert bench.read(R.TORQUE) == pytest.approx(0.0)
    bench.push(-1.0)
    assert bench.read(R.TORQUE) == pytest.approx(-1.0)


def test_a_drive_outside_its_limits_refuses_to_start():
    bench = Bench()
    limits(bench, 0.3, 0.4)
    bench.push(0.0, seconds=0.01)
    assert bench.modes() == [1, 1]
    assert bench.faults() == [FaultCode.START_OUTSIDE_LIMIT] * 2


def test_torque_is_limited_by_the_frame_and_by_the_current(powered):
    powered.push(5.0, maximum=2.0)
    assert powered.read(R.TORQUE) == pytest.approx(2.0)
    assert powered.faults()[0] == Notice.MAX_TORQUE
    powered.robot.drives[0].settings.set("servo.max_current_A", "10")
    powered.push(5.0)
    assert powered.read(R.TORQUE) == pytest.approx(10 * 0.0275 * 6)
    assert powered.faults()[0] == Notice.MAX_CURRENT


def test_voltage_faults_only_where_power_is_on(bench):
    for drive in bench.robot.drives:
        drive.disturbances.voltage = 47 - drive.nominal_voltage
    bench.wait(0.01)
    assert bench.modes() == [0, 0]
    bench.push(0.0, seconds=0.01)
    assert bench.faults() == [FaultCode.OVER_VOLTAGE] * 2
    assert bench.read(R.VOLTAGE) == pytest.approx(47)


def test_a_mode_write_resets_the_command(powered):
    powered.torque(0.5, 0.0)
    powered.cycle(powered.drives[0].make_position(position=math.nan, query=True))
    command = powered.robot.drives[0].command
    assert command[R.COMMAND_FEEDFORWARD_TORQUE] == 0.0
    assert command[R.COMMAND_KD_SCALE] == 1.0


def test_power_up_finds_the_output_within_a_turn_of_the_rotor_only():
    for angle in np.linspace(-3, 3, 25):
        bench = Bench((angle, -1.0), homed=False)
        truth = angle / math.tau
        position, home = bench.read(R.POSITION, R.HOME_STATE)
        assert home == 1
        assert abs(position) <= 1 / 12 + 1e-9
        assert (position - truth) * 6 == pytest.approx(round((position - truth) * 6), abs=1e-5)
        bench.cycle(bench.drives[0].make_set_output_nearest(position=truth + 0.05))
        assert bench.read(R.POSITION) == pytest.approx(truth, abs=1e-6)
        assert bench.read(R.HOME_STATE) == 2


def test_a_wrong_gear_ratio_falsifies_position_and_torque(bench):
    truth = bench.read(R.POSITION)
    bench.robot.drives[0].settings.set("motor_position.rotor_to_output_ratio", "1.0")
    assert bench.read(R.POSITION) == pytest.approx(6 * truth)
    limits(bench, math.nan, math.nan)
    bench.power()
    bench.push(0.1)
    assert bench.robot.leg._legs.measured_torque[0, 0] == pytest.approx(0.6)
    assert bench.read(R.TORQUE) == pytest.approx(0.1)


def test_the_joint_pd_of_the_firmware_holds_a_position(bench):
    target = [bench.read(R.POSITION, drive=n) for n in (0, 1)]
    for _ in range(100):
        frame = {"watchdog_timeout": 1.0, "maximum_torque": 10.0, "query": True}
        pairs = zip(bench.drives, target, strict=True)
        bench.cycle(*(drive.make_position(position=p, **frame) for drive, p in pairs))
        bench.wait(0.005)
    held = [bench.read(R.POSITION, drive=n) for n in (0, 1)]
    np.testing.assert_allclose(held, target, atol=0.02)
    assert bench.robot.leg.foot_clearance < 0.002


def test_the_millisecond_counter_counts_from_power_up():
    bench = Bench()
    bench.wait(1.25)
    assert bench.read(R.MILLISECOND_COUNTER, resolution=moteus.INT32) == pytest.approx(1250, abs=1)
    bench.robot.drives[0].boot(0.0)
    assert bench.read(R.MILLISECOND_COUNTER, resolution=moteus.INT32) == 0


STEP = 5e-4


def run(machine, seconds, time=0.0):
    """Let time pass; return it and the modes on the way."""
    modes = []
    for _ in range(round(seconds / STEP)):
        machine.advance(time)
        modes.append(machine.mode)
        time += STEP
    return time, modes


def running(timeout=math.nan):
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
    machine, time = running(timeout=0.02)
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
    machine, time = running()
    machine.trip(FaultCode.MOTOR_DRIVER)
    for mode in commands:
        machine.command(mode, time, math.nan)
        time, modes = run(machine, 0.01, time)
        assert set(modes) == {DriveMode.FAULT}
        assert machine.fault == FaultCode.MOTOR_DRIVER
    machine.command(DriveMode.STOPPED, time, math.nan)
    run(machine, STEP, time)
    assert (machine.mode, machine.fault) == (DriveMode.STOPPED, 0)
