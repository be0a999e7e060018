"""Recordings and fits belong to their twin, trainings to what is believed of it."""

import dataclasses
import json

import numpy as np
import polars as pl
import pytest
from studies.sim_to_real.run import EFFECTS, HopWithout

from hopping_leg.controllers import RolloutConfig
from hopping_leg.controllers.registry import load_policy
from hopping_leg.errors import UsageError
from hopping_leg.identify.parameters import LegHypothesis
from hopping_leg.identify.pipeline import IdentifyOptions, identify
from hopping_leg.identify.recording import load_recording
from hopping_leg.robot import load_robot
from hopping_leg.sim import NO_NOISE, Measurement
from hopping_leg.sim.randomization import IDENTIFIABLE_RANGES, WIDE_RANGES
from hopping_leg.sim_to_real import stages
from hopping_leg.sim_to_real.stages import HopOnTwin, IdentifyTwin, RecordTwin, TrainPolicy
from hopping_leg.sim_to_real.transfer import fit_row, fits, hops, trainings
from hopping_leg.trace import Trace
from tests.controllers.test_rollout import Constant
from tests.identify.twin import record, swing
from tests.sim_to_real.studies import study


def test_a_recording_belongs_to_its_twin_and_time(tmp_path):
    one = study(tmp_path)
    job = RecordTwin(one, one.twins[0], "rail")
    header = {"robot_digest": one.twins[0].robot.digest, "seconds": 60.0}
    Trace(pl.DataFrame({"time_s": [0.0]}), header).save(job.file)
    assert job.done
    longer = dataclasses.replace(job, study=dataclasses.replace(one, seconds=90.0))
    stranger = dataclasses.replace(job, twin=one.twins[1])
    stranger.file.write_bytes(job.file.read_bytes())
    for other, option in ((longer, "seconds"), (stranger, "robot_digest")):
        with pytest.raises(UsageError, match=rf"other options \({option}\)"):
            assert other.done


LEG = LegHypothesis(load_robot("legv2"))


@pytest.fixture(scope="module")
def identified():
    run = record(LEG.replace({"hip.friction": 0.12}).robot, swing(8.0))
    options = IdentifyOptions(parameters=("hip.friction", "knee.friction"), threads=1)
    return identify([run], LEG.robot, options=options)


def test_a_fit_belongs_to_its_recordings(identified, tmp_path, monkeypatch):
    asked = []

    def fake(recordings, robot, **options):
        asked.append((recordings, robot.name))
        return identified

    monkeypatch.setattr(stages, "identify", fake)
    one = study(tmp_path, ("fixed-base-only",))
    job = IdentifyTwin(one, one.twins[0], one.methods[0])
    assert not job.done
    file = one.recording(one.twins[0], "fixed-base")
    record(LEG.robot, swing(2.0)).save(file)
    job.run(quiet=True)
    [(recordings, believed)] = asked
    assert believed == "legv2"
    assert [r.digest for r in recordings] == [load_recording(file).digest]
    assert job.done
    row = fit_row(job)
    truth = {p["name"]: p["truth"] for p in row["parameters"]}
    assert truth["hip.friction"] == one.twins[0].robot.hip.friction
    record(LEG.robot, swing(3.0)).save(file)
    with pytest.raises(UsageError, match=r"other options \(recordings\)"):
        assert job.done


def test_no_method_but_the_truth_trains_on_what_the_twin_alone_knows(tmp_path):
    names = ("cad", "table-1", "randomised", "truth", "cad-surprises")
    one = study(tmp_path, (*names, "identified", "identified-surprises"))
    twin = one.twins[0]
    trains = [TrainPolicy(one, twin, method, 0) for method in one.methods]
    cad, paper, mixed, truth, surprising, *_ = trains
    assert cad.robot == mixed.robot == surprising.robot == load_robot("legv2")
    assert paper.robot == load_robot("legv2-paper")
    assert cad.recipe().task.randomised == ()
    assert mixed.recipe().task.randomised == IDENTIFIABLE_RANGES
    assert surprising.recipe().task.randomised == WIDE_RANGES
    assert truth.robot.reality.only_delays
    assert truth.robot.rail == twin.robot.rail
    assert truth.robot.reality.latency.command == twin.robot.reality.latency.command
    assert len({one.training(twin, train.method, 0) for train in trains}) == len(trains)
    assert one.fitted(twin, one.methods[-1]) == one.fitted(twin, one.methods[-2])
    assert [job.name for job in fits(one)] == [f"identify {t.name}, identified" for t in one.twins]


def test_a_study_can_change_the_recipe_but_for_its_steps(tmp_path):
    one = study(
        tmp_path, ["cad"], recipe="paper", changes=("task.fall_penalty=0.7", "steps=3"), steps=5
    )
    recipe = TrainPolicy(one, one.twins[0], one.methods[0], 0).recipe()
    assert recipe.task.fall_penalty == 0.7
    assert recipe.schedule.steps == 5


def test_a_training_that_goes_beyond_its_steps_is_done_once(tmp_path):
    one = study(tmp_path, ["cad"], steps=1)
    train = TrainPolicy(one, one.twins[0], one.methods[0], 0)
    assert train.progress() == (0.0, "begun")
    snapshots = one.training(one.twins[0], one.methods[0], 0) / "snapshots"
    snapshots.mkdir(parents=True)
    (snapshots / "000000032768.onnx").touch()
    assert train.progress()[0] == 1.0


@pytest.mark.parametrize("effect", EFFECTS)
def test_one_effect_is_taken_away_and_the_rest_stays(tmp_path, effect):
    one = study(tmp_path, ("identified",))
    twin, method = one.twins[0], one.methods[0]
    whole, less = HopOnTwin(one, twin, method, 0), HopWithout(one, twin, method, 0, effect)
    assert less.leg != whole.leg == twin.robot
    assert not less.leg.reality.only_delays
    assert less.file != whole.file
    for other in set(EFFECTS) - {effect}:
        assert EFFECTS[other](less.leg.reality) != less.leg.reality
    assert EFFECTS[effect](less.leg.reality) == less.leg.reality


def test_without_all_effects_nothing_is_left(tmp_path):
    reality = study(tmp_path).twins[0].robot.reality
    for take_away in EFFECTS.values():
        reality = take_away(reality)
    periods = reality.hip.ripple_periods, reality.knee.ripple_periods
    assert dataclasses.replace(
        reality,
        hip=dataclasses.replace(reality.hip, ripple_periods=1.0),
        knee=dataclasses.replace(reality.knee, ripple_periods=1.0),
    ).neutral
    assert periods != (1.0, 1.0)


def test_a_twin_is_met_with_its_own_effects_alone():
    assert stages.disturbance_of(load_robot("twin")) == NO_NOISE
    assert stages.disturbance_of(load_robot("legv2")).torque_noise > 0


def test_a_leg_that_never_hops_errs_by_the_distance_from_standing(tmp_path):
    one = study(tmp_path, commands=(0.3,), repeats=1)
    (row,) = stages.hop(Constant([0.0, 0.0]), load_robot("legv2-paper"), one)
    standing = RolloutConfig(load_robot("legv2-paper")).standing_length + 0.01
    assert row["motionless"]
    assert row["median_error_m"] == pytest.approx(standing - 0.3, abs=1e-3)
    assert row["median_abs_error_m"] == -row["median_error_m"]
    assert json.dumps(row)


def test_a_policy_is_asked_for_the_nearest_height_of_its_training():
    policy, asked = load_policy("fast"), []
    act = policy.act
    policy.act = lambda seen: asked.append(seen.command) or act(seen)
    within = stages.WithinRange(policy, load_robot("legv2"))
    within.reset(2)
    zeros, command = np.zeros((2, 3, 2)), np.array([[0.3] * 3, [9.0] * 3])
    within.act(Measurement(zeros, zeros, command, np.zeros((2, 3))))
    np.testing.assert_array_equal(asked[0][:, 0], [0.3, policy.card.command_high])


def test_energy_shaping_hops_without_a_training_once_per_twin(tmp_path):
    one = study(tmp_path, ("identified", "energy-shaping"), seeds=(0, 1))
    assert {job.method.name for job in trainings(one)} == {"identified"}
    seeds = [(job.twin.name, job.seed) for job in hops(one) if job.method.controller]
    assert seeds == [("twin-0", 0), ("twin-1", 0)]
    job = next(job for job in hops(one) if job.method.controller)
    assert job.controller.robot == load_robot("legv2"), "it knows the believed leg alone"
