"""Host and emulated drives in lockstep: the real client, the real frames, no clock on the wall."""

import contextlib
import errno
import itertools
import os
import threading
import time
from unittest.mock import Mock

import numpy as np
import pytest
from numba.core import event
from polars.exceptions import PanicException

from hopping_leg.controllers.command_schedule import CommandSchedule
from hopping_leg.controllers.registry import load_controller
from hopping_leg.deploy.drive_info import home, inspect
from hopping_leg.deploy.drive_link import BRAKE
from hopping_leg.deploy.hardware_trials import perform
from hopping_leg.deploy.motion_sequence import MotionSequence, Part, SequenceTiming, hopping_poses
from hopping_leg.deploy.preflight import check_drives, require_fit
from hopping_leg.deploy.safety_limits import hopping_limits
from hopping_leg.deploy.stop_reasons import Reason
from hopping_leg.deploy.supervisor import State
from hopping_leg.emulator.faults import Fault
from hopping_leg.emulator.server import EmulatorConfig
from hopping_leg.emulator.virtual_time import Lockstep
from hopping_leg.errors import HardwareError, TraceError
from hopping_leg.flight_recording import recover
from hopping_leg.robot import SoftLimits, load_robot
from hopping_leg.sim import SoftLimiter
from hopping_leg.trace import Trace
from tests.deploy.fakes import POSES, SHORT, FakeClock, FakeLink, Still

LEG = load_robot("legv2-paper")
LIMITS = hopping_limits(LEG, 200.0)


@pytest.fixture
def emulated():
    """What starts an emulator in lockstep, to be closed after the test."""
    with contextlib.ExitStack() as running:

        def start(robot="legv2-paper", **options):
            lockstep = Lockstep(EmulatorConfig(robot=robot, **options).build())
            running.callback(lockstep.link.close)
            return lockstep

        yield start


def run(lockstep, path, controller="energy-shaping", *, hop=0.5, rise=0.5, checked=None):
    leg = lockstep.robot.robot
    controller = load_controller(controller, leg)
    sequence = MotionSequence(
        controller,
        CommandSchedule(((0.3, 100.0),)),
        hopping_poses(leg),
        SoftLimiter(leg, SoftLimits()),
        SequenceTiming(hop=hop, rise=rise, settle=0.2, sink=0.6),
        checked=checked,
    )
    return perform(lockstep.link, sequence, hopping_limits(leg, 200.0), path, clock=lockstep)


@pytest.mark.parametrize("homed", ["hanging", "standing"])
def test_a_hip_that_turns_the_other_way_never_hops(emulated, tmp_path, homed):
    q = hopping_poses(LEG).start
    hip = -q[0] if homed == "hanging" else q[0]
    wrong = emulated(faults=(Fault("reversed", drive="hip"),), pose=f"{hip},{q[1]}")
    if homed == "standing":
        home(wrong.link, q.tolist())
    require_fit(check_drives(LEG, LIMITS, inspect(wrong.link)))
    done = run(wrong, tmp_path / "wrong.parquet", rise=2.0, checked=LEG)
    assert done.outcome.supervisor.stop_cause.reason is Reason.STANDS_WRONG
    assert np.isnan(done.trace.column("hip_command_nm")).all()
    (event,) = (event for event in done.trace.header["events"] if "squat" in event)
    part, time = done.trace.column("part"), done.trace.column("time_s")
    assert event["time_s"] == pytest.approx(time[part == Part.SQUAT][-1] + 0.005, abs=0.006)
    assert abs(event["squat"]["sideways"]) > 0.2


@pytest.mark.parametrize("lost", [0, 5])
def test_healthy_drives_pass_every_check_also_where_answers_are_lost(emulated, lost):
    lossy = (Fault("drop_reply", since="start", at=0.002 + 0.007 * k) for k in range(lost))
    lockstep = emulated(faults=tuple(lossy))
    facts = inspect(lockstep.link)
    findings = check_drives(LEG, LIMITS, facts)
    require_fit(findings)
    assert {f.joint for f in findings} == {0, 1}
    assert len(findings) == 2 * 14
    assert facts[0].serial != facts[1].serial
    assert len(lockstep.robot.fault_injector.log) == lost
    np.testing.assert_allclose([f.position for f in facts], lockstep.robot.leg.q, atol=1e-3)


def test_nothing_is_compiled_or_loaded_in_a_control_loop(emulated, tmp_path):
    lockstep = emulated()
    SoftLimiter(LEG, SoftLimits())
    with event.install_recorder("numba:compile") as recorder:
        run(lockstep, tmp_path / "run.parquet", hop=0.1)
    assert not recorder.buffer


def test_a_run_is_a_trace_like_any_other_and_the_motors_give_what_was_sent(emulated, tmp_path):
    lockstep = emulated()
    done = run(lockstep, tmp_path / "run.parquet", hop=1.0)
    assert done.outcome.supervisor.stop_cause.reason.name == "FINISHED"
    assert done.outcome.skipped == 0
    trace = Trace.load(tmp_path / "run.parquet")
    assert list(tmp_path.iterdir()) == [tmp_path / "run.parquet"]
    assert trace.header["robot_digest"] == LEG.digest
    assert trace.header["codes"]["state"]["2"] == "running"
    hopping = trace.column("part") == Part.HOP
    assert hopping.sum() == pytest.approx(200, abs=1)
    assert (trace.column("phase")[hopping] >= 0).all()
    assert np.isnan(trace.column("phase")[~hopping]).all()
    running = trace.column("state") == State.RUNNING
    assert (trace.column("knee_mode")[running][1:] == 10).all()
    assert max(height for _, height, *_ in lockstep.truth) > 0.27
    assert [drive.machine.mode for drive in lockstep.robot.drives] == [0, 0]
    for joint in ("hip", "knee"):
        sent, given = trace.column(f"{joint}_sent_nm"), trace.column(f"{joint}_torque_nm")
        difference = (given[1:] - sent[:-1])[hopping[1:]]
        assert np.median(np.abs(difference)) < 0.1


FAULTS = [
    ("legv2-paper", Fault("drive_fault", at=0.9, drive="knee", value=35), "DRIVE_FAULT"),
    ("legv2-paper", Fault("silence", at=0.9), "REPLIES_MISSING"),
    ("legv2-paper", Fault("drop_reply", at=0.9), "FINISHED"),
    *(
        pytest.param("legv2-identified", fault, reason, marks=pytest.mark.slow)
        for fault, reason in (
            (Fault("encoder_jump", at=0.9, drive="hip"), "ENCODER_JUMP"),
            (Fault("over_voltage", at=0.9, value=44.0), "VOLTAGE_HIGH"),
            (Fault("under_voltage", at=0.9, value=12.0), "VOLTAGE_LOW"),
            (Fault("over_temperature", at=0.9, value=500.0), "TOO_HOT"),
            (Fault("power_loss", at=0.9, drive="hip"), "DRIVE_LEFT_MODE"),
            (Fault("limit_notice", at=0.9), "FINISHED"),
        )
    ),
    *(
        ("legv2-identified", Fault(kind, since="flight", at=0.1, drive=drive, value=value), reason)
        for kind, drive, value, reason in (
            ("encoder_dead", "knee", None, "ENCODER_DEAD"),
            ("encoder_dead", "both", None, "ENCODER_DEAD"),
            ("torque_false", "knee", -1.0, "TORQUE_FALSE"),
            ("velocity_false", "hip", 2.0, "VELOCITY_FALSE"),
            ("fast_clock", "knee", 1.05, "DRIVE_CLOCK"),
            ("limit_notice", "both", None, "FINISHED"),
        )
    ),
]


@pytest.mark.parametrize(("robot", "fault", "reason"), FAULTS)
def test_each_fault_ends_the_run_for_its_reason_and_nothing_starts_again(
    emulated, tmp_path, robot, fault, reason
):
    controller = "energy-shaping" if robot == "legv2-paper" else "fast"
    done = run(emulated(robot, faults=(fault,)), tmp_path / "run.parquet", controller, hop=1.2)
    assert done.outcome.supervisor.stop_cause.reason.name == reason
    trace = done.trace
    states = trace.column("state")
    assert (np.diff(states) >= 0).all()
    stopped, limits = states >= State.DAMPING, hopping_limits(load_robot(robot), 200.0).torque
    for joint, limit in zip(("hip", "knee"), limits, strict=True):
        sent = trace.column(f"{joint}_sent_nm")
        assert np.isfinite(sent).all()
        assert np.abs(sent).max() <= limit
        assert not sent[stopped].any()
    assert reason.lower() in [event.get("reason") for event in trace.header["events"]]


class Clock(FakeClock):
    """Moves on its own while a controller does not return."""

    def now(self):
        self.time += 1e-9 if self.stuck is None else 0.1
        return self.time

    stuck = None


def fake_run(tmp_path, controller):
    clock = Clock()
    link = FakeLink(clock)
    link.trouble, link.robot = "", LEG
    sequence = MotionSequence(
        controller, CommandSchedule(((0.3, 100.0),)), POSES, SoftLimiter(LEG, SoftLimits()), SHORT
    )
    limits, file = hopping_limits(load_robot("legv2"), 200.0), tmp_path / "run.parquet"

    def run():
        return perform(link, sequence, limits, file, clock=clock)

    return link, clock, run


@pytest.mark.parametrize("method", ["act", "internals"])
def test_a_controller_that_never_returns_is_left_and_the_drives_brake(tmp_path, method):
    controller, release = Still(), threading.Event()
    link, clock, run = fake_run(tmp_path, controller)
    names = controller.internals()

    def never(*_):
        if controller.calls or method == "act":
            clock.stuck = True
            release.wait(60)
        return names

    setattr(controller, method, never)
    began = time.monotonic()
    with pytest.raises(HardwareError, match=r"did not return .*run\.blackbox` shows"):
        run()
    assert time.monotonic() - began < 30
    assert link.told[-1] == BRAKE
    release.set()
    time.sleep(0.2)
    assert link.told[-1] == BRAKE
    assert recover(tmp_path / "run.blackbox").table.height > 50


def test_the_flight_recording_goes_only_once_the_trace_is_whole(tmp_path, monkeypatch):
    box, trace = tmp_path / "run.blackbox", tmp_path / "run.parquet"
    _, _, run = fake_run(tmp_path, Still())
    save = Trace.save

    def cut(self, path):
        save(Trace(self.table.head(10), self.header), path)

    monkeypatch.setattr(Trace, "save", cut)
    assert f"{box} is kept" in run().complaint
    assert box.exists()
    box.unlink()
    monkeypatch.setattr(Trace, "save", save)
    done = run()
    assert (done.complaint, box.exists()) == ("", False)
    assert Trace.load(trace).table.height == done.outcome.ticks


def test_a_trace_that_cannot_be_written_names_the_stop_and_the_next_command(tmp_path, monkeypatch):
    monkeypatch.setattr(Trace, "save", Mock(side_effect=(PanicException("Bad"), KeyboardInterrupt)))
    controller = Still()
    controller.act = lambda measurement: 1 / 0
    _, _, run = fake_run(tmp_path, controller)
    with pytest.raises(TraceError, match=r"raised an error.*Bad.*blackbox` writes"):
        run()
    (tmp_path / "run.blackbox").unlink()
    with pytest.raises(KeyboardInterrupt):
        run()
    assert recover(tmp_path / "run.blackbox").table.height > 50


@pytest.mark.parametrize("room_again", [True, False])
def test_what_the_recorder_cannot_write_is_told_and_in_the_trace(tmp_path, monkeypatch, room_again):
    write, writes = os.write, itertools.count()

    def full(file, data):
        number = next(writes)
        if number > 100 and not (room_again and number > 150):
            raise OSError(errno.ENOSPC, "No space left on device")
        return write(file, data)

    monkeypatch.setattr("hopping_leg.deploy.flight_recorder.os.write", full)
    _, clock, run = fake_run(tmp_path, Still())
    wait = clock.wait_until
    clock.wait_until = lambda deadline: time.sleep(0.002) or wait(deadline)
    done = run()
    assert any("could not write for a time" in notice for notice in done.notices)
    assert any("No space" in event.get("record", "") for event in done.trace.header["events"])
    assert ("are lost" in done.complaint) is not room_again
    assert (tmp_path / "run.blackbox").exists() is not room_again
    assert (done.trace.table.height == done.outcome.ticks) is room_again


def test_a_loop_that_ran_slowly_is_told(tmp_path):
    _, clock, run = fake_run(tmp_path, Still())
    clock.hiccups = {round(100.005 + 0.005 * tick, 4): 0.012 for tick in range(20, 220, 20)}
    notices = run().notices
    assert any("instead of 200 Hz: this computer was late" in notice for notice in notices)
