"""The verbs that talk to motors, emulated in lockstep, and those that excite and record."""

import functools
import itertools
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from moteus.protocol import Register

from hopping_leg.cli import main
from hopping_leg.controllers.joint_pd import JointGains
from hopping_leg.emulator.faults import Fault
from hopping_leg.evaluate.trials import load_run
from hopping_leg.hop_detection import find_hops, trace_hops
from hopping_leg.identify.recording import load_recording
from hopping_leg.robot import DEFAULT_ROBOT
from hopping_leg.trace import Trace
from tests.cli.emulated import put_behind, write_sine
from tests.robot.files import written

RUN = ["deploy", "energy-shaping", "--transport", "/dev/leg", "--seconds", "0.3"]


@pytest.fixture
def emulate(monkeypatch):
    """Return a function that puts emulated drives behind every transport."""
    return functools.partial(put_behind, monkeypatch)


def test_deploy_checks_runs_and_leaves_a_trace(emulate, tmp_path, capsys):
    lockstep = emulate()
    assert main([*RUN, "--schedule", "0.25:0.1,0.3:0.2", "--yes", "--out", str(tmp_path)]) == 0
    (file,) = tmp_path.iterdir()
    out = capsys.readouterr().out
    assert "In its squat the leg carried" in out
    assert "The sequence is over." in out
    assert file.name in out
    trace = Trace.load(file)
    assert trace.header["robot"] == DEFAULT_ROBOT, "as no policy was trained on another"
    assert trace.header["drives"]["knee"]["homed"] == "yes"
    assert set(np.unique(trace.column("command_m"))) == {0.25, 0.3}
    assert [drive.machine.mode for drive in lockstep.robot.drives] == [0, 0]
    assert main(["report", str(file), "--out", str(tmp_path / "figures")]) == 0
    assert list((tmp_path / "figures").glob("*.svg"))


def sensing(tmp_path, source, extends="legv2-paper"):
    """Write a robot with a height sensor, which is in a boom's pivot if it is an encoder."""
    reach = (1.2 * source.startswith("encoder"), "m")
    numbers = {"zero": (0.3, "1"), "offset": (0.4, "m"), "scale": (2.0, "m"), "radius": reach}
    text = {f"hardware.height.{name}": number for name, number in numbers.items()}
    path = Path(written(tmp_path / "leg.toml", text, extends))
    words = f'hardware.height.source = "{source}"\nhardware.height.drive = "knee"'
    path.write_text(f"{path.read_text()}\n{words}")
    return str(path)


@pytest.mark.parametrize("source", ["encoder_1_position", "aux2_analog_in3", "{}/line"])
def test_a_measured_height_is_recorded_and_its_apexes_reported(emulate, tmp_path, source):
    lockstep = emulate(robot=(robot := sensing(tmp_path, source.format(tmp_path))))
    drive, answers = lockstep.robot.drives[1], itertools.count()

    def lossy(registers):
        lost = () if next(answers) % 5 else drive.sensed
        return {register: value * (register not in lost) for register, value in registers.items()}

    drive.disturbances.report = lossy
    words = [*RUN[:-1], "3.5", "--robot", robot, "--yes", "--out", str(tmp_path / "run")]
    assert main(words) == 0
    (file,) = (tmp_path / "run").iterdir()
    trace = Trace.load(file)
    measured = np.stack([trace.column(name) for name in ("height_m", "foot_clearance_m")])
    known = np.isfinite(measured).all(axis=0).mean()
    assert known > 0.95 if "line" in source else known == pytest.approx(0.8, abs=0.01)
    _, *truth = np.array(lockstep.truth)[-measured.shape[1] :, :3].T
    assert np.nanpercentile(np.abs(measured - truth), 98) < 0.005
    hops = np.isfinite(trace.column("hip_command_nm"))
    height, clearance = np.array(truth)[:, hops]
    true = find_hops(height, np.gradient(height), clearance)
    run = load_run(file)
    assert run.controller == "energy-shaping, measured"
    assert run.trace.column("time_s")[[0, -1]] == pytest.approx([0.0, 3.495])
    assert len(true.apex) >= 4
    np.testing.assert_allclose(trace_hops(run.trace).apex, true.apex, atol=0.003)
    assert main(["report", str(file), "--out", str(tmp_path / "figures")]) == 0
    assert "energy-shaping, measured" in (tmp_path / "figures" / "heights.svg").read_text()


def test_a_height_sensor_that_is_silent_is_named_before_the_leg_moves(emulate, tmp_path, refused):
    lockstep = emulate(robot=(robot := sensing(tmp_path, "encoder_1_position")))
    lockstep.robot.drives[1].disturbances.report = lambda r: r | {Register.ENCODER_VALIDITY: 1}
    refused([*RUN, "--robot", robot, "--yes"], "the height sensor (encoder_1_position) gives")


@pytest.mark.slow
def test_a_fault_is_a_sentence_and_an_exit_code(emulate, tmp_path, refused):
    emulate(faults=(Fault("drive_fault", at=0.6, drive="hip", value=33),))
    refused([*RUN, "--yes", "--out", tmp_path], "hip: fault 33 (motor driver)) The joints")
    assert len(list(tmp_path.glob("*.parquet"))) == 1


def test_doctor_says_what_is_wrong_and_puts_it_right(emulate, capsys):
    emulate(configured=False, homed=False)
    words = ["doctor", "--transport", "/dev/leg", "--yes"]
    assert main(words) == 2
    out = capsys.readouterr().out
    assert "servo.timeout_mode is 12 but must be 15" in out
    assert "not homed" in out
    robot = emulate(configured=False, homed=False).robot
    angles = [f"{angle:.3f}" for angle in robot.leg.q]
    assert main([*words, "--write", "--home", *angles]) == 0
    assert "may be armed" in capsys.readouterr().out
    for drive, wire, q in zip(robot.drives, robot.leg.transforms, robot.leg.q, strict=True):
        drive.settings.load()
        assert drive.settings["servo.timeout_mode"] == 15, "written for good"
        assert drive.encoder.position == pytest.approx(wire.motor_position(q), abs=1e-3)


def check_recording(recording, played):
    """Check what holds of a recording whoever played the excitation."""
    assert (recording.metadata.rig, recording.metadata.onboard) == (played.rig, "zoh")
    assert recording.has_column("height_m") == (played.rig == "rail")
    np.testing.assert_array_equal(recording.array("position_command"), played.position)
    assert np.nanmax(np.abs(recording.array("position") - played.position)) < 0.4
    assert np.nanstd(recording.array("torque")[1:]) > 0.1


@pytest.mark.parametrize("rig", ["fixed-base", pytest.param("rail", marks=pytest.mark.slow)])
def test_a_recording_from_motors_is_one_that_identification_takes(emulate, tmp_path, rig):
    robot = sensing(tmp_path, "aux1_analog_in2", extends="legv2")
    emulate(robot=robot, faults=(Fault("drop_reply", at=1.0, drive="hip"),))
    file, played = write_sine(tmp_path, rig, 400)
    words = ["record", "play", str(file), "--transport", "/dev/leg", "--yes", "--robot", robot]
    assert main([*words, "--out", str(tmp_path / "r")]) == 0
    recording = load_recording(tmp_path / "r" / "mine-sine.parquet")
    check_recording(recording, played)
    assert recording.metadata.robot == robot
    measured, torque = recording.array("position"), recording.array("torque")
    assert np.isnan(measured).sum() == 1
    stiffness, damping = map(np.array, (recording.metadata.stiffness, recording.metadata.damping))
    asked = stiffness * (played.position - measured) - damping * recording.array("velocity")
    assert np.nanmedian(np.abs(torque[1:] - asked[:-1])) < 0.05


def test_a_leg_that_folds_onto_its_stop_when_its_torques_fade_has_finished(tmp_path, monkeypatch):
    motors = ["--motor", "ak80-9", "ak80-6", "--set", "knee.belt_ratio=1.5"]
    robot = str(tmp_path / "leg.toml")
    assert main(["robots", "import", "examples/leg.urdf", *motors, "--out", robot]) == 0
    put_behind(monkeypatch, robot=robot, pose="stand")
    words = ["--transport", "/dev/null", "--seconds", "2", "--yes", "--out", str(tmp_path)]
    assert main(["deploy", "energy-shaping", "--robot", robot, *words]) == 0


def test_the_emulator_names_the_terminal_and_ends_with_ctrl_c(tmp_path):
    link = tmp_path / "leg"
    words = [sys.executable, "-m", "hopping_leg.cli", "emulate", "--robot", "legv1"]
    pipe = subprocess.PIPE
    process = subprocess.Popen([*words, "--link", link], stdout=pipe, stderr=pipe, text=True)
    try:
        assert process.stdout.readline() == f"Drives 1 and 2 of legv1 behind {link}\n"
        assert link.resolve().parent == Path("/dev/pts")
        process.send_signal(signal.SIGINT)
        rest, errors = process.communicate(timeout=30)
    finally:
        process.kill()
    assert process.returncode == 0, errors
    assert "The emulator ended" in rest
    assert not errors
    assert not link.is_symlink()


def test_the_emulator_tells_faults_and_changes_of_mode(tmp_path, capsys):
    script = tmp_path / "faults.toml"
    script.write_text('[[fault]]\nkind = "encoder_jump"\nsince = "start"\nat = 0.1\ndrive = "hip"')
    assert main(["emulate", "--faults", str(script), "--seconds", "0.3"]) == 0
    assert "fault: a joint's angle is wrong from now on (hip)" in capsys.readouterr().out


@pytest.mark.parametrize("rig", ["fixed-base", "rail"])
def test_a_recording_holds_what_was_played_and_measured(tmp_path, rig):
    file, played = write_sine(tmp_path, rig, 300)
    out = tmp_path / "out"
    words = ["record", "play", str(file), "--robot", "twin", "--stiffness", "25", "15", "--out"]
    assert main([*words, str(out)]) == 0
    assert main([*words, str(tmp_path / "again")]) == 0
    assert main([*words, str(tmp_path / "other"), "--seed", "5"]) == 0
    name = f"twin-{file.name}"
    content = (out / name).read_bytes()
    assert content == (tmp_path / "again" / name).read_bytes()
    assert content != (tmp_path / "other" / name).read_bytes()
    recording = load_recording(out / name)
    check_recording(recording, played)
    metadata = recording.metadata
    assert (metadata.robot, metadata.sample) == ("legv2-paper", "before-command")
    assert (metadata.stiffness, metadata.damping) == ((25.0, 15.0), JointGains().damping)
    np.testing.assert_array_equal(recording.array("velocity_command"), 0.0)
    steps = recording.array("position") / [6.4e-5, 3.2e-5]
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-6)
