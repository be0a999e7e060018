import numpy as np
import pytest

from hopping_leg.errors import UsageError
from hopping_leg.identify.parameters import choose
from tests.identify.searches import CAD, TWO


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
