import numpy as np
import pytest

from hopping_leg.identify.least_squares import Found
from hopping_leg.identify.two_pass import two_pass
from tests.identify.searches import CAD


def test_the_second_pass_stays_near_the_first():
    def search(name, parameters):
        names.append((name, parameters))
        shift = 1.0 if name == "first" else 0.0
        return Found(np.clip(np.full(len(parameters.names), shift), *parameters.bounds), 1.0, 1, [])

    names = []
    result = two_pass(CAD, ["fixed-base", "rail"], search)
    (_, first), (_, second) = names
    assert "thigh.inertia" not in first.names
    assert {"thigh.inertia", "contact.time_constant", "rail.damping"} <= set(second.names)
    found = dict(zip(first.names, first.values(result.first.vector), strict=True))
    for p in second.parameters:
        if p.name in found:
            assert p.start == pytest.approx(found[p.name])
            assert p.low == 0 or p.low >= 0.49 * p.start - p.scale
    assert result.best.get("hip.damping") == pytest.approx(found["hip.damping"])
