"""Recordings and fits belong to their twin; training knows what is believed of it."""

import dataclasses

import polars as pl
import pytest
from tests.identify.twin import record, swing

from hopping_leg.errors import UsageError
from hopping_leg.identify.parameters import LegHypothesis
from hopping_leg.identify.pipeline import IdentifyOptions, identify
from hopping_leg.identify.recording import load_recording
from hopping_leg.robot import load_robot
from hopping_leg.sim import NO_NOISE
from hopping_leg.trace import Trace
from studies.sim_to_real import twins
from studies.sim_to_real.twins import (
    IdentifyTwin,
    RecordTwin,
    disturbance_of,
    drawn_twin,
    given_twin,
    simulated,
)


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

    monkeypatch.setattr(twins, "identify", fake)
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


def test_a_twin_is_met_with_its_own_effects_alone():
    assert disturbance_of(load_robot("twin")) == NO_NOISE
    assert disturbance_of(load_robot("legv2")).torque_noise > 0
