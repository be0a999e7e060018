"""The whole identification on a twin: planned, found, judged, refused."""

import dataclasses

import numpy as np
import polars as pl
import pytest

from hopping_leg.errors import PhysicsError, RecordingError, RobotError
from hopping_leg.identify import pipeline
from hopping_leg.identify.optimizers import Found, Pass
from hopping_leg.identify.parameters import LegHypothesis, parameter_units
from hopping_leg.identify.pipeline import identify
from hopping_leg.identify.plan import make_plan
from hopping_leg.identify.recording_format import PAIRS
from hopping_leg.identify.result import as_json, save_robot
from hopping_leg.io import replace_at
from hopping_leg.robot import NO_MISMATCH, check_physics, load_robot, robot_text
from tests.identify.fitting import EFFORT, RATE, TRUTH, TWIN, identified, options, run
from tests.identify.twin import BELT, LEG, changed, hops, record, swing, tracked

STEPS_APART = 5e-4
"""What twins that were recorded in larger physics steps than the plan's differ by, rad."""


def test_the_twin_is_found_and_predicted_where_the_fit_saw_nothing():
    found = identified()
    fitted, judged = (np.concatenate([r.time for r in part]) for part in (found.fit, found.held))
    assert not set(fitted) & set(judged)
    assert len(judged) == pytest.approx(0.25 * len(run()), abs=2)
    for name, value in TRUTH.items():
        assert found.hypothesis.get(name) == pytest.approx(value, rel=5e-3)
    assert max(found.validation.closed_loop_position_rms_rad) < STEPS_APART
    assert max(found.start_validation.closed_loop_position_rms_rad) > 1e-3
    assert found.split == "held-out stretches"


def test_recordings_to_judge_by_replace_the_split_and_nobody_believes_a_reality():
    found = identify([run()], load_robot("twin"), validate=[run(1.0)], options=options())
    assert [r.name for r in found.fit] == [run().name]
    assert [r.name for r in found.held] == [run(1.0).name]
    assert found.robot.reality == NO_MISMATCH


def test_a_belt_is_found_from_a_far_start_and_what_is_stated_of_it_stays(tmp_path):
    stated, file = BELT | {"reality.knee.stiffness": 900.0}, tmp_path / "stated.toml"
    tree = {"name": "stated", "extends": "legv2"}
    for name, value in (stated | {"reality.latency.jitter": 1e-3}).items():
        unit = parameter_units()[name]
        tree = replace_at(tree, name, {"value": value, "unit": unit, "source": "guessed"})
    file.write_text(robot_text(tree))
    runs = [hops(LegHypothesis(LEG).replace(BELT).robot, 6.0)]
    names = ("knee.friction", "reality.knee.stiffness")
    found = identify(runs, load_robot(file), options=options(parameters=names))
    assert found.start.get(names[1]) == 900.0
    assert [one.name for one in found.passes] == ["least-squares, first", "least-squares, second"]
    assert found.passes[1].found.cost < found.passes[0].found.cost
    assert found.hypothesis.get(names[1]) == pytest.approx(300.0, rel=0.3)
    save_robot(found, tmp_path / "mine.toml", file)
    reality = load_robot(tmp_path / "mine.toml").reality
    assert reality.knee == found.robot.reality.knee
    assert reality.knee.stiffness_damping == 0.03
    assert reality.latency.jitter == 0


def test_each_rig_is_judged_for_itself():
    stand = record(TWIN, swing(6.0, "rail", rate=RATE), "rail", rate=RATE, name="squats")
    few = dataclasses.replace(EFFORT, generations=1)
    found = identify([run(), stand], LEG, options=options(search="cma", effort=few))
    assert set(found.by_rig) == {"fixed-base", "rail"}
    errors = [v.closed_loop_position_rms_rad[0] for v in found.by_rig.values()]
    assert min(errors) < found.validation.closed_loop_position_rms_rad[0] < max(errors)
    assert "rail" in as_json(found)["validation_by_rig"]
    assert identified().by_rig == {}


@pytest.mark.parametrize("search", ["least-squares", "cma", "two-pass"])
def test_the_same_seed_finds_the_same_bits_and_its_progress_only_rises(search):
    few = dataclasses.replace(EFFORT, generations=2)
    chosen, shares = options(search=search, effort=few), []
    found = [
        identify(
            [run()], LEG, options=chosen, seed=3, report=lambda _, share, __: shares.append(share)
        )
        for _ in range(2)
    ]
    assert as_json(found[0]) == as_json(found[1])
    one = shares[: len(shares) // 2]
    assert one == sorted(one) == shares[len(one) :]
    assert one[-1] <= 1.0


@pytest.mark.slow
def test_a_cluster_changes_no_bit():
    pytest.importorskip("ray", reason="Ray is not installed (extra 'cluster')")
    for search in ("cma", "least-squares"):
        here, there = (
            identify([run()], LEG, options=options(search=search, ray=ray))
            for ray in (None, "local")
        )
        assert as_json(here) == as_json(there)


def test_a_fit_that_breaks_down_is_no_result(monkeypatch):
    def ending_high(plan, *_, **__):
        upper = plan.parameters.bounds[1]
        return [Pass("", plan.parameters, Found(upper, 1.0, 1, [1.0]))]

    monkeypatch.setattr(pipeline, "search", ending_high)
    name = "drive.hip.stiffness"
    chosen = options(parameters=(name,), bounds={name: (0.0, 1e12)})
    strong = run().with_metadata(gains_exact=False, onboard="continuous", torque_limit=(1e12, 1e12))
    motor = dataclasses.replace(LEG.hip.motor, peak_torque=1e12, no_load_speed=1e12)
    robot = dataclasses.replace(LEG, hip=dataclasses.replace(LEG.hip, motor=motor))
    with pytest.raises(PhysicsError, match="The fit failed"):
        identify([strong], robot, options=chosen)


@pytest.mark.parametrize("joint", ["hip", "knee"])
def test_a_motor_is_never_found_weaker_than_its_own_limit(joint):
    name = f"{joint}.motor.peak_torque"
    (found,) = make_plan([FIXED], LEG, parameters=(name,)).parameters.parameters
    least, most = found.low, found.high
    check_physics(LegHypothesis(LEG).replace({name: least}).robot, "the weakest")
    with pytest.raises(RobotError, match="peak_torque"):
        check_physics(LegHypothesis(LEG).replace({name: 0.99 * least}).robot, "weaker still")
    assert least < LegHypothesis(LEG).get(name) < most


FIXED = record(LEG, swing(1.0))
STANDING = record(LEG, swing(1.0, "rail"), "rail")
TORQUES = record(LEG, swing(1.0), onboard="torque")


def on(rig="fixed-base", onboard="continuous", **gains):
    return FIXED.with_metadata(rig=rig, onboard=onboard, **gains)


STRONG = {"stiffness": (800.0, 800.0), "damping": (0.0, 0.0)}


@pytest.mark.parametrize(
    ("recordings", "fitted", "kept"),
    [
        ([FIXED], "knee.torque_gain", "rail.friction"),
        ([FIXED], "thigh.inertia", "contact.time_constant"),
        ([FIXED, STANDING], "rail.friction", "drive.knee.stiffness"),
        ([FIXED, STANDING], "contact.time_constant", "hip.armature"),
        ([on(onboard="zoh", stiffness=None)], "drive.knee.stiffness", "drive.knee.damping"),
        ([on(onboard="zoh", stiffness=None)], "drive.hip.stiffness", "knee.torque_gain"),
        ([on(gains_exact=False)], "drive.knee.stiffness", "hip.motor.peak_torque"),
        ([on(gains_exact=False, **STRONG)], "hip.motor.peak_torque", "knee.load_friction"),
        ([on(gains_exact=False, **STRONG)], "knee.motor.no_load_speed", "rail.friction"),
        ([TORQUES], "knee.load_friction", "knee.torque_gain"),
        ([FIXED, on("rail", "zoh")], "knee.load_friction", "drive.hip.damping"),
        ([FIXED], "hip.friction", "knee.load_friction"),
        ([on("rail")], "rail.friction", "knee.load_friction"),
        ([FIXED, STANDING], "rail.friction", "reality.knee.stiffness"),
    ],
)
def test_what_recordings_can_tell_is_fitted_and_what_is_known_is_kept(recordings, fitted, kept):
    names = make_plan(recordings, LEG).parameters.names
    assert fitted in names
    assert kept not in names


def test_what_is_asked_for_with_a_plus_is_fitted_besides():
    def names(*asked):
        return make_plan([FIXED], LEG, parameters=asked or None).parameters.names

    assert names("+hip.armature") == [*names(), "hip.armature"]
    assert names("rail.friction", "+hip.friction") == ["rail.friction", "hip.friction"]


def test_a_plan_has_short_windows_where_nothing_holds_the_leg_and_begins_at_doubtful_gains():
    closed, opened = (make_plan([r], LEG).window for r in (FIXED, TORQUES))
    assert opened < closed
    assert make_plan([FIXED, STANDING], LEG).window <= 0.25
    doubtful = make_plan([FIXED.with_metadata(gains_exact=False)], LEG)
    assert doubtful.start.get("drive.knee.stiffness") == FIXED.metadata.stiffness[1]
    assert doubtful.scoring.in_full == ("position",)
    papers = make_plan([FIXED, STANDING], LEG, search="two-pass")
    assert (papers.scoring.torque, papers.scoring.robust) == (None, None)
    assert "thigh.inertia" in papers.parameters.names


ANGLES = ("position", "position_command")
OF_A_JOINT = (*ANGLES, "velocity", "torque", "velocity_command")
COMMANDS = ("position_command", "velocity_command")
TURNED = (*ANGLES, "velocity", "velocity_command")


@pytest.mark.parametrize("joint", [0, 1])
@pytest.mark.parametrize(
    ("names", "change", "onboard", "sentence"),
    [
        (OF_A_JOINT, lambda column: -column, "zoh", "sign"),
        (("torque",), lambda column: -column, "zoh", "sign"),
        (ANGLES, lambda column: column + np.pi / 2, "zoh", "zero"),
        (ANGLES, lambda column: column + np.pi, "zoh", "zero"),
        (TURNED, lambda column: column / (2 * np.pi), "zoh", "revolutions for radians"),
        (("position",), lambda column: column * None, "zoh", "no positions of the .*both joints"),
        (COMMANDS, lambda column: column * None, "torque", "no commanded torques .*onboard"),
        (COMMANDS, lambda column: column * None, "continuous", "has no targets of its"),
    ],
)
def test_what_cannot_be_the_leg_is_refused_before_any_fit(names, change, onboard, sentence, joint):
    joints = (0, 1) if names in (COMMANDS, TURNED) else (joint,)
    columns = pl.col([PAIRS[name][j] for name in names for j in joints])
    wrong = changed(tracked(), change(columns)).with_metadata(onboard=onboard)
    with pytest.raises(RecordingError, match=sentence):
        identify([wrong], LEG, options=options())


def test_a_knee_whose_angle_counts_from_the_vertical_is_told():
    columns = (pl.col(PAIRS[name][1]) + pl.col(PAIRS[name][0]) for name in TURNED)
    with pytest.raises(RecordingError, match="if the line that the knee's angle counts from"):
        identify([changed(tracked(), *columns)], LEG, options=options())
