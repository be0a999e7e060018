import math

import numpy as np
import pytest
from moteus.fdcanusb_device import _strip_and_validate_checksum

from hopping_leg.deploy.drive_link import DriveMode, FaultCode
from hopping_leg.deploy.frames import Frame
from hopping_leg.emulator.faults import KINDS, Fault, load_faults
from hopping_leg.emulator.ports import PtyPort
from hopping_leg.emulator.reply_queue import QueuedReply
from hopping_leg.errors import UsageError
from tests.emulator.bench import Bench, R


def hopping(*faults, seconds=0.1, watchdog=1.0):
    """Run torque commands at 200 Hz; return the bench and the replies of each tick."""
    bench = Bench(held=False, faults=faults)
    bench.power()
    ticks = []
    for _ in range(round(seconds / 0.005)):
        ticks.append(bench.torque(0.02, -0.02, watchdog=watchdog))
        bench.wait(0.005)
    return bench, ticks


def answers(ticks):
    """Return how many drives answered in each tick."""
    return [len(replies) for replies in ticks]


def test_silence_lasts_as_long_as_it_says():
    _, ticks = hopping(Fault("silence", at=0.03, duration=0.03))
    silent = np.flatnonzero(np.equal(answers(ticks), 0))
    assert (silent == silent[0] + np.arange(6)).all()


@pytest.mark.parametrize(
    ("fault", "stray", "alone"),
    [
        (Fault("late_reply", at=0.03, value=0.012, drive="hip"), 1, 1),
        (Fault("duplicate_reply", at=0.03, drive="knee"), 2, 0),
    ],
)
def test_a_late_or_second_reply_arrives_when_nobody_waits_for_it(fault, stray, alone):
    bench, ticks = hopping(fault)
    assert answers(ticks).count(1) == alone
    assert [frame.source for frame in bench.strays] == [stray]


@pytest.mark.parametrize("checksums", [True, False])
def test_a_corrupted_line_fails_its_checksum_or_means_something_else(checksums):
    port, lines = PtyPort(), []
    port._write = lines.append
    port._protocol.checksums = checksums
    frame = Frame(0x100, bytes.fromhex("20040001020304"))
    for flip in (-1, 0, 5, 77, 4711, 65535):
        port.send(QueuedReply(frame, flip=flip))
    port.close()
    good, *broken = (_strip_and_validate_checksum(line.strip()) for line in lines)
    assert good[2] == checksums
    for bad in broken:
        assert good[1] == bad[1] == checksums
        assert not bad[2]
        before, after = (line[0].split(b" ") for line in (good, bad))
        assert before.pop(2) != after.pop(2)
        assert before == after


def test_an_encoder_jump_moves_what_is_reported_not_the_leg():
    bench, ticks = hopping(Fault("encoder_jump", at=0.03, value=0.5, drive="knee"))
    positions = np.array([replies[1].values[R.POSITION] for replies in ticks])
    jumps = np.abs(np.diff(positions)) * math.tau / 2
    assert (jumps > 0.4).sum() == 1
    assert jumps.max() == pytest.approx(0.5, abs=0.1)
    truth = bench.robot.leg.transforms[1].motor_position(bench.robot.leg.q[1])
    assert bench.read(R.POSITION, drive=1) - truth == pytest.approx(0.5 * 2 / math.tau, abs=1e-6)


@pytest.mark.parametrize(
    ("fault", "code"),
    [
        (Fault("drive_fault", at=0.03, value=33, drive="hip"), FaultCode.MOTOR_DRIVER),
        (Fault("over_temperature", at=0.0, value=1000, drive="hip"), FaultCode.OVER_TEMPERATURE),
        (Fault("over_voltage", at=0.03, drive="hip"), FaultCode.OVER_VOLTAGE),
        (Fault("under_voltage", at=0.03, value=3, drive="hip"), FaultCode.UNDER_VOLTAGE),
    ],
)
def test_drive_faults_switch_off_and_stay(fault, code):
    _, ticks = hopping(fault)
    assert ticks[-1][0].values[R.MODE] == DriveMode.FAULT
    assert ticks[-1][0].values[R.FAULT] == code
    assert ticks[-1][0].values[R.TORQUE] == 0.0
    assert ticks[-1][1].values[R.MODE] == DriveMode.POSITION


def test_power_loss_stops_the_drive_and_forgets_its_home():
    bench, ticks = hopping(Fault("power_loss", at=0.03, drive="hip"), seconds=0.035)
    modes = [replies[0].values[R.MODE] for replies in ticks]
    assert modes[0] == DriveMode.POSITION
    assert DriveMode.STOPPED in modes or modes[-1] in (DriveMode.ENABLING, DriveMode.CALIBRATING)
    assert bench.read(R.HOME_STATE) == 1


def test_a_pulled_plug_silences_the_host_and_trips_the_watchdogs():
    _, ticks = hopping(Fault("unplug", at=0.03, duration=0.06), seconds=0.14, watchdog=0.02)
    gone = np.flatnonzero(np.equal(answers(ticks), 0))
    assert 11 <= len(gone) <= 13
    back = ticks[gone[-1] + 1]
    assert [reply.values[R.MODE] for reply in back] == [DriveMode.TIMEOUT, DriveMode.TIMEOUT]


def test_a_wrong_start_is_there_from_the_start():
    bench = Bench(
        faults=(
            Fault("boot_pose", value=2, drive="hip"),
            Fault("configuration", name="servo.timeout_mode", value=12, drive="knee"),
        )
    )
    truth = bench.robot.leg.transforms[0].motor_position(bench.robot.leg.q[0])
    assert bench.read(R.POSITION) == pytest.approx(truth + 2 / 6)
    assert bench.read(R.HOME_STATE) == 1
    assert [d.settings["servo.timeout_mode"] for d in bench.robot.drives] == [15, 12]


def test_a_fault_waits_for_the_first_flight_of_powered_drives():
    bench = Bench(held=False, faults=[Fault("limit_notice", since="flight")])
    bench.robot.leg._legs.place(slice(None), 0.5, np.array([0.6, -1.3]))
    bench.wait(0.01)
    assert not bench.robot.fault_injector.log
    bench.power()
    ((begun, _),) = bench.robot.fault_injector.log
    assert begun == bench.robot.fault_injector.flown >= bench.robot.fault_injector.powered


def test_a_script_is_read(tmp_path):
    file = tmp_path / "faults.toml"
    file.write_text(
        '[[fault]]\nkind = "late_reply"\nat = 2\nvalue = 0.01\n[[fault]]\nkind="unplug"'
    )
    late, unplug = load_faults(file)
    assert (late.at, late.amount) == (2, 0.01)
    assert unplug.lasts == KINDS["unplug"].duration


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ('[[fault]]\nkind = "late"', "There is no fault kind 'late'"),
        ('[[fault]]\nkind = "unplug"\nat = -1', "'at': Expected `float` >= 0.0"),
        ('[[fault]]\nkind = "unplug"\ncount = 0', "'count': Expected `int` >= 1"),
        ('[[fault]]\nkind = "configuration"\nname = "servo.x"', "There is no drive setting"),
        ("x = 1", "must hold tables"),
    ],
)
def test_mistakes_in_a_script_are_one_sentence(tmp_path, text, sentence):
    file = tmp_path / "faults.toml"
    file.write_text(text)
    with pytest.raises(UsageError, match=sentence) as error:
        load_faults(file)
    assert str(file) in str(error.value)
