"""Hops on boom and rail: found from the base's course or from the joints, and good for a fit."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from hopping_leg.errors import RecordingError
from hopping_leg.identify import hops
from hopping_leg.identify.pipeline import IdentifyOptions, identify
from hopping_leg.identify.recording import load_recording, make_recording
from hopping_leg.identify.recording_format import MEASURED, PAIRS, RecordingMetadata
from hopping_leg.identify.result import save_robot
from hopping_leg.identify.simulate import cut
from hopping_leg.robot import Boom, kinematics, load_robot
from hopping_leg.sim import LegSimulator
from tests.identify.runs import RECORDINGS, needs_recordings

CAD = load_robot("legv2")
BOOM = Boom(1.146, 0.3, 0.378, masses=((1.3, -0.7, 0.3), (0.9, 0.45, 0.0)))
TRUE = replace(CAD, knee=replace(CAD.knee, friction=0.2), boom=replace(BOOM, weight=0.8))
ON_RAIL = replace(TRUE, boom=Boom())
REST, AIR = np.array([1.5, -2.2]), np.array([0.9, -1.9])


def hopping(robot=TRUE, count=4):
    """Return a recording of hops that begin at rest, and the rows of lift-offs and touchdowns."""
    legs = LegSimulator(robot, 1, timestep=2.5e-4)
    legs.stand(slice(None), REST)
    rows, changes, pushing, length = [], ([], []), False, 0.0
    for tick in range(200 * count):
        phase = tick % 200
        q, qd, touching = legs.q[0], legs.qd[0], legs.foot_clearance()[0] <= 0
        pushing = phase == 40 or (phase > 40 and pushing and length < 0.2)
        length = np.hypot(*kinematics.foot_position(robot, q))
        target = REST if phase < 40 or phase > 130 else AIR
        torque = [30.0, 30.0] * (target - q) - [1.0, 1.0] * qd
        if pushing:
            torque = kinematics.jacobian(robot, q).T @ [60.0 + 5 * (tick // 200), 0.0]
        rows.append([tick / 200, *q, *qd, *legs.measured_torque[0], *torque, legs.height[0]])
        legs.step(np.array([torque]))
        if tick > 40 and (legs.foot_clearance()[0] > 0) == touching:
            changes[not touching].append(tick + 1)
    names = ["time_s", *MEASURED, *PAIRS["torque_command"], "height_m"]
    rig, boom = ("boom", BOOM) if robot.boom.radius else ("rail", Boom())
    metadata = RecordingMetadata(rig, 200.0, "legv2", "simulated", boom=boom)
    return make_recording(pl.DataFrame(np.array(rows), names), metadata, "hops"), changes


def unmeasured(recording):
    """Return a recording whose base nobody measured."""
    return recording.with_table(recording.trace.table.drop("height_m"))


@pytest.fixture(scope="module")
def recorded():
    return hopping()


@pytest.mark.parametrize("robot", [TRUE, ON_RAIL], ids=["boom", "rail"])
def test_course_and_joints_tell_flights_and_joints_how_high(robot):
    recording, (lifted, landed) = hopping(robot, 2)
    told, true = hops.with_height(unmeasured(recording), CAD), recording.trace.column("height_m")
    rise, up, down = hops.base_height(told), lifted[0], landed[0]
    known = np.flatnonzero(~np.isnan(rise))
    assert abs(known[known > 45].min() - up) <= 2
    assert abs(known[known < down + 20].max() - down) <= 2
    assert np.nanmax(rise[up:down]) == pytest.approx(true[up:down].max(), abs=0.035)
    for flight in hops.flights(recording, CAD) + hops.flights(told, CAD):
        assert min(abs(flight.start - row) for row in lifted) <= 6
        assert 0 < flight.start - flight.rest < 60


def test_a_window_begins_at_rest_or_lies_in_a_flight(recorded):
    recording, _ = recorded
    height, rate = hops.start_heights(recording, CAD)
    slope = np.gradient(recording.trace.column("height_m"), recording.time)
    for window in cut([recording], 0.25):
        if np.isnan(height[window.start]):
            assert np.abs(recording.array("velocity")[window.start]).max() < 0.3
            assert window.joints < window.length
        else:
            assert window.joints == window.length
            true = recording.trace.column("height_m")[window.start]
            assert height[window.start] == pytest.approx(true, abs=0.015)  # the ground gives
            assert rate[window.start] == pytest.approx(slope[window.start], abs=0.05)


def test_hops_tell_friction_and_weight(recorded, tmp_path):
    recording, _ = recorded
    other, _ = hopping(count=2)
    options = IdentifyOptions(parameters=("knee.friction", "boom.weight"))
    found = identify([recording], CAD, validate=[other], options=options)
    friction, weight = found.identifiability.values
    save_robot(found, tmp_path / "leg.toml", "legv2")
    saved = load_robot(tmp_path / "leg.toml")
    assert saved.knee.friction == pytest.approx(friction)
    assert saved.boom == Boom()
    assert friction == pytest.approx(0.2, abs=0.03)
    assert weight == pytest.approx(0.8, abs=0.3)  # of 18 N: the ground has not yet given at a start


def test_hops_on_a_rail_tell_friction_without_a_height():
    run, other = (unmeasured(hopping(ON_RAIL, count)[0]) for count in (4, 3))
    options = IdentifyOptions(parameters=("knee.friction", "contact.time_constant"))
    found = identify([run], CAD, validate=[other], options=options)
    assert found.identifiability.values == pytest.approx([0.2, 0.02], rel=0.1)
    (hip, knee), *_ = found.validation.open_loop_position_rms_rad.values()
    assert max(hip, knee) < 0.003


def test_a_boom_without_a_height_or_hops_is_refused(recorded):
    recording = recorded[0]
    for run in (recording, unmeasured(recording)):
        with pytest.raises(RecordingError, match="No flight"):
            identify([run.part(0, 40)], CAD, validate=[recording])
    standing = unmeasured(hopping(ON_RAIL, 1)[0]).part(0, 40)
    assert hops.with_height(standing, CAD).trace.table.equals(standing.trace.table)


def test_a_boom_is_kept_in_a_file_and_an_older_field_passed_over(recorded, tmp_path):
    recorded[0].save(tmp_path / "hops.parquet")
    assert load_recording(tmp_path / "hops.parquet").metadata == recorded[0].metadata
    recorded[0].trace.table.write_csv(tmp_path / "run.csv")
    sidecar = 'rig = "rail"\nrate_hz = 200.0\nrobot = "legv2"\nsource = "x"\n'
    (tmp_path / "run.toml").write_text(f"{sidecar}effective_gravity = 9.81\n")
    assert load_recording(tmp_path / "run.csv").metadata.rig == "rail"


def test_a_boom_is_described_and_only_a_boom():
    with pytest.raises(RecordingError, match="describe a boom"):
        RecordingMetadata("boom", 200.0, "legv2", "x")
    with pytest.raises(RecordingError, match="only a boom"):
        RecordingMetadata("rail", 200.0, "legv2", "x", boom=BOOM)


@needs_recordings
def test_the_labs_folder_is_read_as_it_is():
    """Signs, torques behind the belt, and a height that closes the standing leg's kinematics."""
    recording = load_recording(RECORDINGS / "legv2_boom_200hz" / "static" / "stateData.csv.gz")
    assert recording.metadata.rate_hz == 200.0
    found = hops.flights(recording, CAD)
    assert len(found) >= 10
    rests = [flight.rest for flight in found if flight.rest]
    assert (recording.array("position")[rests, 1] < 0).all()
    standing = kinematics.stance_height(CAD, recording.array("position")[rests])
    assert np.median(np.abs(recording.trace.column("height_m")[rests] - standing)) < 2e-3
    assert np.abs(recording.array("torque_command")[:, 1]).max() > 12.0
    told = hops.flights(hops.with_height(unmeasured(recording), CAD), CAD)
    off = [abs(blind.start - flight.start) for blind, flight in zip(told, found, strict=True)]
    assert max(*off, 4 * np.median(off)) <= 12
