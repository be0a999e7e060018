"""Recordings and fits belong to their twin, trainings to what is believed of it."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from hopping_leg.controllers import RolloutConfig
from hopping_leg.controllers.registry import load_policy
from hopping_leg.errors import UsageError
from hopping_leg.identify.parameters import LegHypothesis
from hopping_leg.identify.pipeline import IdentifyOptions, identify
from hopping_leg.identify.recording import load_recording
from hopping_leg.robot import load_robot
from hopping_leg.sim import NO_NOISE, Measurement
from hopping_leg.sim_to_real import transfer
from hopping_leg.sim_to_real.transfer import (
    IdentifyTwin,
    RecordTwin,
    TrainPolicy,
    Transfer,
    WithinRange,
    drawn_twin,
    given_twin,
    simulated,
)
from hopping_leg.trace import Trace
from tests.controllers.test_rollout import Constant
from tests.identify.twin import record, swing


@pytest.fixture
def twin(tmp_path):
    return drawn_twin(0, tmp_path / "twins")


def test_a_drawn_twin_is_the_same_each_time_and_believed_to_be_the_cad(twin, tmp_path):
    assert drawn_twin(0, tmp_path / "twins") == twin
    assert twin.believed == "legv2"
    assert drawn_twin(1, tmp_path).robot.digest != twin.robot.digest
    assert not twin.robot.reality.only_delays


def test_a_twin_of_ones_own_extends_what_is_believed_of_it(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text('name = "mine"\nextends = "legv2-paper"\n')
    mine, shipped = given_twin(str(file)), given_twin("twin")
    assert (mine.name, mine.believed) == ("mine", "legv2-paper")
    assert shipped.name == "twin"
    with pytest.raises(UsageError, match="extends no robot"):
        given_twin("legv2")


def test_training_knows_the_delay_and_no_other_surprise():
    known = simulated("twin")
    assert known.reality.only_delays
    assert known.reality.latency.command == load_robot("twin").reality.latency.command
    assert dataclasses.replace(load_robot("legv2-paper").hip, armature=known.hip.armature) == (
        known.hip
    )
    assert simulated("legv2") == load_robot("legv2")


def test_a_recording_belongs_to_its_twin_and_time(tmp_path, twin):
    job = RecordTwin(tmp_path / "recording.parquet", twin, "rail", 60.0)
    header = {"robot_digest": twin.robot.digest, "seconds": 60.0}
    Trace(pl.DataFrame({"time_s": [0.0]}), header).save(job.file)
    assert job.done
    longer = dataclasses.replace(job, seconds=90.0)
    stranger = dataclasses.replace(job, twin=drawn_twin(1, tmp_path))
    for other, option in ((longer, "seconds"), (stranger, "robot_digest")):
        with pytest.raises(UsageError, match=rf"other options \({option}\)"):
            assert other.done


def test_a_twin_that_goes_to_its_stops_is_recorded(tmp_path, twin):
    job = RecordTwin(tmp_path / "rail.parquet", twin, "rail")
    job.run(quiet=True)
    assert job.done
    lowest = load_recording(job.file).array("position").min()
    assert lowest < twin.robot.knee.stop_lower, "belts and stops give way"


LEG = LegHypothesis(load_robot("legv2"))


@pytest.fixture(scope="module")
def identified():
    run = record(LEG.replace({"hip.friction": 0.12}).robot, swing(8.0))
    options = IdentifyOptions(parameters=("hip.friction", "knee.friction"), threads=1)
    return identify([run], LEG.robot, options=options)


def test_a_fit_belongs_to_its_recordings(identified, tmp_path, monkeypatch, twin):
    asked = []

    def fake(recordings, robot, **options):
        asked.append((recordings, robot.name))
        return identified

    monkeypatch.setattr(transfer, "identify", fake)
    file = tmp_path / "fixed-base.parquet"
    job = IdentifyTwin(tmp_path / "fitted.toml", twin, (file,))
    assert not job.done
    record(LEG.robot, swing(2.0)).save(file)
    job.run(quiet=True)
    [(recordings, believed)] = asked
    assert believed == "legv2"
    assert [r.digest for r in recordings] == [load_recording(file).digest]
    assert job.done
    truth = {p["name"]: p["truth"] for p in job.row()["parameters"]}
    assert truth["hip.friction"] == twin.robot.hip.friction
    record(LEG.robot, swing(3.0)).save(file)
    with pytest.raises(UsageError, match=r"other options \(recordings\)"):
        assert job.done


def test_a_training_that_goes_beyond_its_steps_is_done_once(tmp_path):
    pytest.importorskip("torch")
    from hopping_leg.rl.recipes.fast import FAST

    train = TrainPolicy(tmp_path, "legv2", FAST.replace(steps=1))
    assert train.progress() == (0.0, "begun")
    snapshots = tmp_path / "snapshots"
    snapshots.mkdir()
    (snapshots / "000000032768.onnx").touch()
    assert train.progress()[0] == 1.0


def test_a_twin_is_met_with_its_own_effects_alone():
    assert transfer.disturbance_of(load_robot("twin")) == NO_NOISE
    assert transfer.disturbance_of(load_robot("legv2")).torque_noise > 0


def test_a_leg_that_never_hops_errs_by_the_distance_from_standing():
    (row,) = transfer.hop(Constant([0.0, 0.0]), load_robot("legv2-paper"), (0.3,), 1)
    standing = RolloutConfig(load_robot("legv2-paper")).standing_length + 0.01
    assert row["motionless"]
    assert row["median_error_m"] == pytest.approx(standing - 0.3, abs=1e-3)
    assert row["median_abs_error_m"] == -row["median_error_m"]
    assert json.dumps(row)


def test_each_controller_knows_what_its_method_says_of_the_twin(tmp_path, twin):
    pytest.importorskip("torch")
    from hopping_leg.rl.recipes.fast import FAST

    run = Transfer(tmp_path, twin, FAST, seed=3)
    assert [record.rig for record in run.records] == ["fixed-base", "rail"]
    assert run.fit.file == Path(run.trainings[0].source) == run.identified
    assert run.trainings[1].source == "legv2"
    assert [hop.method for hop in run.hops] == ["identified", "cad", "energy-shaping"]
    assert [hop.policy and hop.policy.parent.name for hop in run.hops] == [
        "twin-0-identified-seed3", "legv2-seed3", None,
    ]  # fmt: skip
    assert all(hop.leg == twin.robot for hop in run.hops)
    assert run.hops[2].controller.robot == load_robot("legv2"), "it knows the believed leg alone"


def test_a_policy_is_asked_for_the_nearest_height_of_its_training():
    policy, asked = load_policy("fast"), []
    act = policy.act
    policy.act = lambda seen: asked.append(seen.command) or act(seen)
    within = WithinRange(policy, load_robot("legv2"))
    within.reset(2)
    zeros, command = np.zeros((2, 3, 2)), np.array([[0.3] * 3, [9.0] * 3])
    within.act(Measurement(zeros, zeros, command, np.zeros((2, 3))))
    np.testing.assert_array_equal(asked[0][:, 0], [0.3, policy.card.command_high])
