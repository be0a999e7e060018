import numpy as np
import pytest

from hopping_leg.errors import RecordingError
from hopping_leg.identify.parameters import LegHypothesis
from hopping_leg.identify.pipeline import hold_out
from hopping_leg.identify.simulate import WindowSimulator, cut
from hopping_leg.identify.validation import validate
from tests.identify.twin import BELT, LEG, STEP, changed, hops, record, swing

TRUE = LegHypothesis(LEG)
FREE = TRUE.replace({"hip.friction": 0.0, "knee.friction": 0.0})
OTHER = TRUE.replace({"hip.friction": 0.3, "shank.inertia": 4e-4, "contact.time_constant": 0.05})


def simulator(recordings, duration=None, **options):
    return WindowSimulator(recordings, cut(recordings, duration), timestep=STEP, **options)


@pytest.mark.parametrize(("rig", "error"), [("fixed-base", 1e-4), ("rail", 5e-4)])
@pytest.mark.parametrize("hypothesis", [TRUE, OTHER], ids=["true", "other"])
def test_the_replay_repeats_what_mujoco_recorded(rig, error, hypothesis):
    run = record(hypothesis.robot, swing(1.0, rig), rig)
    coarse, fine = (
        WindowSimulator([run], cut([run]), timestep=step).run([TRUE, hypothesis])
        for step in (STEP, STEP / 4)
    )
    for got, share in ((coarse, 1.0), (fine, 0.5)):
        assert np.abs(got.position[1, 0] - run.array("position")).max() < share * error
        assert np.abs(got.velocity[1, 0] - run.array("velocity")).max() < 50 * share * error
        assert np.abs(got.torque[1, 0] - run.array("torque")).max() < 20 * share * error
        height = got.height[1, 0] - run.trace.column("height_m") if rig == "rail" else 0.0
        assert np.abs(height).max() < share * error


def test_windows_on_the_rail_start_with_the_speed_of_the_base():
    run = record(LEG, swing(2.0, "rail"), "rail")
    assert np.abs(np.gradient(run.trace.column("height_m"), 0.005)).max() > 0.3
    got = simulator([run], 0.1).run([TRUE]).position[0]
    assert np.abs(got - run.array("position").reshape(20, 20, 2)).max() < 3e-3


@pytest.mark.parametrize(("rig", "error", "share"), [("fixed-base", 3e-4, 2), ("rail", 5e-3, 0.3)])
def test_a_leg_with_a_belt_is_replayed_from_what_its_motors_show(rig, error, share):
    belt, run = TRUE.replace(BELT), hops(TRUE.replace(BELT).robot, 2.0, rig)
    got = WindowSimulator([run], cut([run], 0.2), timestep=STEP / 4).run([belt, TRUE])
    errors = got.position - run.array("position").reshape(10, 40, 2)
    own, rigid = np.sqrt(np.mean(errors**2, axis=(1, 2)))
    assert (own < error).all()
    assert (own < share * rigid).all()


def test_a_candidate_does_not_depend_on_its_company_nor_on_threads():
    runs = [record(LEG, swing(0.5)), record(LEG, swing(0.5, "rail"), "rail")]
    alone = simulator(runs, 0.25, threads=1).run([OTHER])
    among = simulator(runs, 0.25, threads=2).run([TRUE, OTHER, TRUE])
    np.testing.assert_array_equal(among.position[1], alone.position[0])
    np.testing.assert_array_equal(among.torque[1], alone.torque[0])


def test_a_continuous_pd_is_the_limit_of_a_fast_sampled_one():
    run = record(LEG, swing(1.0))
    continuous = simulator([run.with_metadata(onboard="continuous")]).run([TRUE]).position
    sampled = simulator([run]).run([TRUE]).position
    exact = record(LEG, np.repeat(swing(1.0), 5, axis=0), rate=1000.0).array("position")[::5]
    assert np.abs(continuous[0, 0] - exact).max() < 0.3 * np.abs(sampled[0, 0] - exact).max()


def test_delay_shifts_the_answer():
    run = record(LEG, swing(1.0), onboard="torque")
    late = simulator([run]).run([TRUE.replace({"drive.delay": 0.01})]).torque[0, 0]
    np.testing.assert_allclose(late[10:], run.array("torque_command")[7:-3], atol=1e-9)


def test_rows_are_met_at_their_own_time_stamps_and_commands_within_a_step():
    run = record(LEG, swing(1.0), onboard="torque")
    jitter = np.random.default_rng(0).uniform(-0.4, 0.4, len(run)) * run.metadata.period
    run = changed(run, time_s=run.time + jitter * (np.arange(len(run)) > 0))
    late = FREE.replace({"drive.delay": 0.0013})
    coarse, half, fine = (
        WindowSimulator([run], cut([run]), timestep=step).run([late]).position[0, 0, :40]
        for step in (STEP, STEP / 2, STEP / 32)
    )
    effect = np.abs(simulator([run]).run([FREE]).position[0, 0, :40] - fine).max()
    assert np.abs(half - fine).max() < 0.02 * effect
    assert np.abs(coarse - fine).max() < 0.05 * effect


def test_an_unknown_gain_gets_a_sentence():
    run = record(LEG, swing(0.5)).with_metadata(stiffness=None)
    with pytest.raises(RecordingError, match="does not say the stiffness"):
        simulator([run]).run([TRUE])
    fitted = TRUE.replace({"drive.hip.stiffness": 8.0, "drive.knee.stiffness": 8.0})
    assert np.isfinite(simulator([run]).run([fitted]).position).all()


def test_a_candidate_that_breaks_down_spoils_no_other():
    run = record(LEG, swing(0.5), onboard="torque").with_metadata(torque_limit=(1e12, 1e12))
    wild = TRUE.replace({"hip.torque_gain": 1e9, "hip.motor.peak_torque": 1e12})
    got = simulator([run]).run([wild, TRUE]).position
    assert np.isnan(got[0]).all()
    np.testing.assert_allclose(got[1, 0], run.array("position"), atol=1e-3)


RUN = record(LEG, swing(3.0))


def test_windows_tile_a_recording_and_a_part_says_which_seconds_it_is():
    rows = [r for w in cut([RUN], 0.5) for r in range(w.start, w.start + w.length)]
    assert rows == list(range(len(RUN)))
    (window,) = cut([RUN], unscored=0.1)
    assert (window.start, window.length, window.unscored) == (0, 600, 20)
    with pytest.raises(RecordingError, match="too short for windows of 5 s"):
        cut([RUN], 5.0)
    run = RUN.part(200, 400)
    assert run.name.endswith("1.0-2.0 s")
    np.testing.assert_array_equal(run.array("position"), RUN.array("position")[200:400])


LONG = record(LEG, swing(60.0))


@pytest.mark.parametrize("seed", range(4))
def test_every_fourth_stretch_is_held_out_and_nothing_is_lost(seed):
    fit, held = hold_out([LONG], 2.0, np.random.default_rng(seed))
    assert sorted(np.concatenate([r.time for r in (*fit, *held)])) == LONG.time.tolist()
    assert sum(map(len, held)) == pytest.approx(0.25 * len(LONG), abs=4)
    np.testing.assert_allclose(np.diff([r.time[0] for r in held]), 20.0, atol=0.02)


def test_a_short_recording_gives_its_last_quarter():
    (fit,), (held,) = hold_out([record(LEG, swing(8.0))], 4.0, np.random.default_rng(0))
    assert len(fit) == 3 * len(held)
    assert fit.time[-1] < held.time[0]
    with pytest.raises(RecordingError, match=r"5 s, but 5\.34 s are needed.*--validate"):
        hold_out([record(LEG, swing(5.0))], 4.0, np.random.default_rng(0))


WRONG = TRUE.replace({"hip.friction": 0.4})


def judge(hypothesis, onboard="zoh"):
    return validate([record(LEG, swing(2.0), onboard=onboard)], hypothesis)


@pytest.mark.parametrize("onboard", ["zoh", "torque"])
def test_the_true_robot_predicts_its_own_recording(onboard):
    validation = judge(TRUE, onboard)
    if onboard == "zoh":
        assert max(validation.closed_loop_position_rms_rad) < 1e-4
        assert max(validation.closed_loop_torque_rms_nm) < 1e-3
    assert all(max(pair) < 1e-3 for pair in validation.open_loop_position_rms_rad.values())


def test_without_torques_there_is_no_open_loop():
    bare = changed(record(LEG, swing(2.0)), hip_torque_nm=None, knee_torque_nm=None)
    validation = validate([bare], TRUE)
    assert np.isnan(validation.closed_loop_torque_rms_nm).all()
    assert np.isnan(validation.open_loop_position_rms_rad["0.2"]).all()


def test_where_torques_are_commanded_no_loop_is_closed():
    validation = judge(WRONG, "torque")
    assert np.isnan(
        [*validation.closed_loop_position_rms_rad, *validation.closed_loop_torque_rms_nm]
    ).all()
    assert validation.open_loop_position_rms_rad["0.2"][0] > 1e-3
    closed, commanded = (record(LEG, swing(2.0), onboard=name) for name in ("zoh", "torque"))
    both = validate([closed, commanded], WRONG).closed_loop_position_rms_rad
    assert both == validate([closed], WRONG).closed_loop_position_rms_rad
