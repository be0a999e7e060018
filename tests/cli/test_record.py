import json

import numpy as np
import pytest

from hopping_leg.cli import main
from hopping_leg.controllers.joint_pd import JointGains
from hopping_leg.identify.excitation import load_excitation
from hopping_leg.identify.recording import load_recording
from tests.cli.emulated import write_sine


@pytest.mark.parametrize("rig", ["fixed-base", "rail"])
def test_a_recording_holds_what_was_played_and_measured(tmp_path, rig):
    file, played = write_sine(tmp_path, rig, 300)
    out = tmp_path / "out"
    words = ["record", str(file), "--robot", "twin", "--stiffness", "25", "15", "--out"]
    assert main([*words, str(out)]) == 0
    assert main([*words, str(tmp_path / "again")]) == 0
    assert main([*words, str(tmp_path / "other"), "--seed", "5"]) == 0
    name = f"twin-{file.name}"
    content = (out / name).read_bytes()
    assert content == (tmp_path / "again" / name).read_bytes()
    assert content != (tmp_path / "other" / name).read_bytes()
    recording = load_recording(out / name)
    metadata = recording.metadata
    assert metadata.rig == played.rig
    assert (metadata.onboard, metadata.sample) == ("zoh", "before-command")
    assert metadata.stiffness == (25.0, 15.0)
    assert metadata.damping == JointGains().damping
    assert metadata.robot == "legv2-paper"
    assert len(recording) == 300
    np.testing.assert_array_equal(recording.array("position_command"), played.position)
    np.testing.assert_array_equal(recording.array("velocity_command"), 0.0)
    position = recording.array("position")
    assert np.abs(position - played.position).max() < 0.4
    steps = position / [6.4e-5, 3.2e-5]
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-6)
    assert recording.array("torque")[1:].std() > 0.1
    assert recording.has_column("height_m") == (played.rig == "rail")


def test_wrong_input_is_one_sentence(tmp_path, refused):
    file, _ = write_sine(tmp_path, "rail", 300)
    for words, sentence in (
        ([], "No excitation"),
        ([str(tmp_path / "none.parquet")], "none.parquet"),
        ([str(file), "--robot", "twinn"], "Did you mean 'twin'"),
        ([str(file), "--believed", "legv9"], "There is no robot 'legv9'"),
        ([str(file), "--seed", "-1"], "--seed is -1"),
        ([str(file), "--damping", "-1", "0"], "must be zero or more"),
    ):
        refused(["record", *words, "--out", tmp_path / "out"], sentence)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("words", "rig", "samples"),
    [
        (["fixed-base"], "fixed-base", 48000),
        (["moving-base", "--duration", "30"], "rail", 6000),
        (["multisine", "--duration", "20", "--rate", "100"], "fixed-base", 2000),
    ],
)
def test_each_template_is_written_and_summed_up(tmp_path, words, rig, samples):
    out, facts = tmp_path / "excitation.parquet", tmp_path / "facts.json"
    assert main(["excite", *words, "--out", str(out), "--json", str(facts)]) == 0
    excitation = load_excitation(out)
    assert (excitation.rig, len(excitation)) == (rig, samples)
    told = json.loads(facts.read_text())
    assert told["digest"] == excitation.digest
    assert told["largest"]["speed_rad_s"][1] < 22


def test_what_the_leg_cannot_do_is_not_written(tmp_path, refused):
    out = tmp_path / "excitation.parquet"
    refused(["excite", "fixed-base", "--no-adapt", "--out", out], "cannot follow the trajectory")
    assert not out.exists()
