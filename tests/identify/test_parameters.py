import numpy as np
import pytest

from hopping_leg.errors import RecordingError, UsageError
from hopping_leg.identify.cost import Scoring
from hopping_leg.identify.identifiability import identifiability
from hopping_leg.identify.optimizers import jacobian
from hopping_leg.identify.parameters import choose
from hopping_leg.robot import COARSE_TIMESTEP
from hopping_leg.sim.leg_table import stiffest
from tests.identify.searches import CAD, RUN, TRUTH, TWO, objective
from tests.identify.twin import changed, record, swing


@pytest.mark.parametrize(
    ("names", "sentence"),
    [
        (["hip.friction", "hip.friction"], "named twice"),
        (["drive.hip.stiffness"], "no value to start from"),
        ([], "nothing to fit"),
    ],
)
def test_parameters_that_make_no_sense_get_a_sentence(names, sentence):
    with pytest.raises(UsageError, match=sentence):
        choose(CAD, names)


def test_a_stiffness_is_searched_in_shares_and_stays_one_that_can_be_simulated():
    name = "reality.knee.stiffness"
    with pytest.raises(UsageError, match="no value to start from"):
        choose(CAD, [name])
    both = choose(CAD, [name, "hip.friction"], start={name: 400.0}, bounds={name: (0.0, 1e4)})
    values = np.array([[100.0, 0.1], [400.0, 0.2], [1600.0, 0.3]])
    vectors = both.vector(values)
    np.testing.assert_allclose(both.values(vectors), values, rtol=1e-12)
    assert vectors[2, 0] == pytest.approx(-vectors[0, 0])
    step = 1e-6 * np.eye(2)
    slopes = [(both.values(v + step) - both.values(v)).diagonal() / 1e-6 for v in vectors]
    np.testing.assert_allclose([both.scale_at(v) for v in vectors], slopes, rtol=1e-4)
    stiff = both.hypotheses(both.vector(np.array([[1e4, 0.1]])))[0]
    assert stiff.get(name) == stiffest(CAD.robot, "knee", COARSE_TIMESTEP) < 1e4


def test_only_the_sum_of_armature_and_inertia_is_identifiable():
    run = record(CAD.replace(TRUTH).robot, swing(1.0))
    parameters = choose(CAD.replace(TRUTH), ["hip.friction", "hip.armature", "thigh.inertia"])
    goal = objective(parameters, recordings=[run])
    noise = np.random.default_rng(0).normal(size=goal.groups.size)
    slopes = jacobian(goal.residuals, np.zeros(3), parameters.bounds)
    known = identifiability(parameters, np.zeros(3), noise, slopes, 0 * noise)
    assert abs(known.correlation[1, 2]) > 0.99
    assert any("hip.armature" in s and "thigh.inertia" in s for s in known.statements)
    assert not any("hip.friction" in s for s in known.statements)


def test_intervals_cover_the_truth_as_often_as_they_say():
    rng = np.random.default_rng(1)
    slopes = rng.normal(size=(200, 2))
    covered = 0
    for _ in range(300):
        noise = rng.normal(size=200)
        vector = np.linalg.lstsq(slopes, noise, rcond=None)[0]
        known = identifiability(TWO, vector, noise - slopes @ vector, slopes, 0 * noise)
        covered += int((np.abs(known.values - TWO.start) <= known.half_width).sum())
    assert 0.91 < covered / 600 < 0.99


def test_draws_vary_together_as_the_data_and_another_friction_law_let_them():
    rng = np.random.default_rng(0)
    slopes = rng.normal(size=(2000, 2)) @ np.array([[1.0, 0.9], [0.0, 0.1]])
    noise, scale = rng.normal(size=2000), TWO.scale
    for share in (0.0, 0.3):
        change = share * slopes @ np.ones(2)
        known = identifiability(TWO, np.zeros(2), noise, slopes, change)
        deviation = np.sqrt(np.diag(known.covariance))
        np.testing.assert_allclose(1.96 * deviation, known.half_width, rtol=1e-4)
        tied = known.covariance / np.outer(deviation, deviation)
        if not share:
            np.testing.assert_allclose(tied, known.correlation, atol=1e-9)
        else:  # both move together, against what the data alone would let them
            assert known.correlation[0, 1] < -0.9 < tied[0, 1]
            np.testing.assert_array_less(share * scale, known.half_width)


def test_what_the_data_do_not_touch_is_said():
    slopes = np.zeros((50, 2))
    slopes[:, 0] = 1.0
    noise = np.random.default_rng(0).normal(size=50)
    known = identifiability(TWO, np.ones(2), noise, slopes, 0 * noise)
    assert known.half_width[1] == np.inf
    assert "These data say nothing about 'knee.friction'." in known.statements


HERE = np.zeros((1, 2))  # The CAD's values among vectors of two parameters


def test_the_paper_cost_is_the_sum_of_squared_position_errors():
    goal = objective(scoring=Scoring(), length=None)
    simulated = goal.simulator.run([CAD]).position[0, 0, 1:]
    expected = np.sum((simulated - RUN.array("position")[1:]) ** 2)
    assert goal(HERE)[0] == pytest.approx(expected, rel=1e-12)


def test_a_robust_cost_counts_small_errors_alike_and_large_ones_less():
    plain, robust = (
        objective(scoring=Scoring(position=0.01, robust=bound), length=None).residuals(HERE)
        for bound in (None, 0.5)
    )
    small, large = np.abs(plain) < 0.02, np.abs(plain) > 1.0
    np.testing.assert_allclose(robust[small], plain[small], rtol=1e-3, atol=1e-8)
    assert large.any()
    assert (np.abs(robust[large]) < np.abs(plain[large])).all()


def test_unmeasured_samples_do_not_count():
    run, torques = changed(RUN, hip_torque_nm=None), Scoring(None, torque=1.0)
    both, one = (objective(scoring=torques, recordings=[r]).groups.size for r in (RUN, run))
    assert one == both / 2
    mute = objective(scoring=torques, recordings=[changed(run, knee_torque_nm=None)])
    with pytest.raises(RecordingError, match="is no measured sample"):
        mute.residuals(HERE)


def test_the_height_of_the_base_tells_of_the_rail():
    truth = CAD.replace({"rail.friction": 2.0})
    air, ground = record(truth.robot, swing(1.0)), record(truth.robot, swing(2.0, "rail"), "rail")
    friction, scoring = choose(truth, ["rail.friction"]), Scoring(position=None, height=1e-3)
    goal = objective(friction, scoring, [air, ground], 0.1)
    assert goal.groups.size == 20 * 19
    at_truth, beside = goal(friction.vector(np.array([[2.0], [0.5]])))
    assert at_truth < 0.01 * beside
    with pytest.raises(RecordingError, match="record height"):
        objective(friction, scoring, [air], 0.1).residuals(HERE[:, :1])
