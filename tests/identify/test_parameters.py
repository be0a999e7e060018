import numpy as np
import pytest

from hopping_leg.errors import UsageError
from hopping_leg.identify.identifiability import identifiability
from hopping_leg.identify.optimizers import jacobian
from hopping_leg.identify.parameters import choose
from tests.identify.searches import CAD, TRUTH, TWO, objective
from tests.identify.twin import record, swing


@pytest.mark.parametrize(
    ("names", "bounds", "sentence"),
    [
        (["hip.frction"], {}, "Did you mean 'hip.friction'"),
        (["hip.friction"], {"hip.friction": (0.5, 1.0)}, "exclude its start"),
        (["hip.friction", "hip.friction"], {}, "named twice"),
        (["drive.hip.stiffness"], {}, "no value to start from"),
        ([], {}, "nothing to fit"),
    ],
)
def test_parameters_that_make_no_sense_get_a_sentence(names, bounds, sentence):
    with pytest.raises(UsageError, match=sentence):
        choose(CAD, names, bounds=bounds)


def test_vectors_and_values_are_inverse():
    values = np.array([0.3, 0.2])
    np.testing.assert_allclose(TWO.values(TWO.vector(values)), values)
    (hypothesis,) = TWO.hypotheses(TWO.vector(values)[None])
    assert hypothesis.get("hip.friction") == pytest.approx(0.3)


def test_only_the_sum_of_armature_and_inertia_is_identifiable():
    run = record(CAD.replace(TRUTH).robot, swing(1.0))
    parameters = choose(CAD.replace(TRUTH), ["hip.friction", "hip.armature", "thigh.inertia"])
    goal = objective(parameters, recordings=[run])
    noise = np.random.default_rng(0).normal(size=goal.groups.size)
    slopes = jacobian(goal.residuals, np.zeros(3), parameters.bounds, 1e-3)
    known = identifiability(parameters, np.zeros(3), noise, slopes)
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
        known = identifiability(TWO, vector, noise - slopes @ vector, slopes)
        covered += int((np.abs(known.values - TWO.start) <= known.half_width).sum())
    assert 0.91 < covered / 600 < 0.99


def test_what_the_data_do_not_touch_is_said():
    slopes = np.zeros((50, 2))
    slopes[:, 0] = 1.0
    known = identifiability(TWO, np.ones(2), np.random.default_rng(0).normal(size=50), slopes)
    assert known.half_width[1] == np.inf
    assert "These data say nothing about 'knee.friction'." in known.statements
