import numpy as np
import pytest
from scipy.ndimage import uniform_filter1d

from hopping_leg.identify.feasibility import inverse_dynamics
from hopping_leg.identify.importers import IMPORTERS, recognise
from hopping_leg.identify.recording import load_recording
from hopping_leg.identify.recording_format import COLUMNS
from hopping_leg.robot import load_robot
from tests.identify.runs import RECORDINGS, needs_recordings

FILES = sorted(RECORDINGS.glob("*/*.csv.gz"))


@pytest.mark.parametrize("name", IMPORTERS)
def test_a_rig_is_recognised_by_its_own_columns_only(name):
    importer = IMPORTERS[name]
    assert recognise(sorted(importer.columns)) is importer
    assert recognise(sorted(importer.columns)[1:]) is not importer
    assert set(importer.names.values()) <= set(COLUMNS)


@needs_recordings
@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_real_recordings_are_believed(path):
    recording = load_recording(path)
    rig = IMPORTERS[path.parent.name.replace("doublependulum_fixed_base", "doublependulum")]
    assert (recording.metadata.robot, recording.metadata.source) == (
        rig.metadata.robot,
        rig.metadata.source,
    )
    assert len(recording) > 700
    assert recording.has("position")
    assert recording.has("velocity")
    known = ("stall", "start-up rows", "kept as a command of zero")
    assert all(any(word in warning for word in known) for warning in recording.warnings)
    period = np.median(np.diff(recording.time))
    assert period * recording.metadata.rate_hz == pytest.approx(1, rel=0.02)


@needs_recordings
def test_interpolated_samples_never_count_as_measured():
    path = next((RECORDINGS / "legv2_fixed_base").glob("*seg0*"))
    recording = load_recording(path)
    shares = [np.isfinite(recording.array(q)).mean() for q in ("position", "velocity", "torque")]
    np.testing.assert_allclose(shares, [0.11, 0.18, 0.40], atol=0.06)
    assert np.isfinite(recording.array("position_estimate")).all()
    assert 0.6 < recording.exact_time.mean() < 0.9
    measured, estimate = recording.array("position"), recording.array("position_estimate")
    assert np.nanmax(np.abs(measured - estimate)) < 1e-6


@needs_recordings
def test_the_boom_says_what_the_base_did():
    recording = load_recording(next((RECORDINGS / "legv2_boom").glob("one_hurdle_big*")))
    assert recording.metadata.rig == "boom"
    assert recording.metadata.effective_gravity == 4.5
    assert 0.1 < np.nanmax(recording.trace.column("base_rise_m")) < 1.0
    assert np.nanmax(np.abs(recording.array("torque_command"))) < 13
    assert recording.trace.table["row"][0] == 3


@needs_recordings
@pytest.mark.parametrize("run", ["00", "04", "11"])
def test_the_pendulum_file_explains_the_pendulums_torques(run):
    """Signs, order of joints and the lab's numbers fit together: inverse dynamics says so."""
    recording = load_recording(
        next((RECORDINGS / "doublependulum_fixed_base").glob(f"*_{run}.csv.gz"))
    )
    position, velocity, torque = (
        uniform_filter1d(recording.array(name), 25, axis=0)
        for name in ("position", "velocity", "torque")
    )
    acceleration = np.gradient(velocity, recording.time, axis=0)
    robot = load_robot("doublependulum")
    predicted = inverse_dynamics(robot, "fixed-base", position, velocity, acceleration)
    agreement = [np.corrcoef(*pair)[0, 1] for pair in zip(predicted.T, torque.T, strict=True)]
    assert (np.array(agreement) > [0.3, 0.9]).all(), agreement
