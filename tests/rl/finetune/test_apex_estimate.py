"""Heights estimated from the time in the air are those of a leg that flies like a stone."""

import numpy as np

from hopping_leg.rl.finetune.trial_data import TrialData

from .trials import PERIOD, estimator, flying_leg


def measured(q):
    nothing = np.zeros_like(q)
    return TrialData(q, nothing, nothing, nothing, np.full((len(q), 1), 0.3), PERIOD)


def estimate(hops):
    q, height, flying = flying_leg(hops)
    return estimator(flying)(measured(q)), height, flying


def test_apexes_of_a_stone_are_found_within_the_clocks_resolution():
    found, _, _ = estimate([0.28, 0.33, 0.38])
    np.testing.assert_allclose(found.apexes[0][:, 1], [0.28, 0.33, 0.38], atol=0.004)


def test_height_and_flight_follow_the_parabola():
    found, height, flying = estimate([0.33])
    np.testing.assert_allclose(found.height[:, 0], height, atol=0.008)
    assert (found.flying[:, 0] != flying).sum() <= 2


def test_a_flicker_of_contact_does_not_cut_a_flight():
    q, _, flying = flying_leg([0.36])
    middle = int(np.flatnonzero(flying).mean())
    flying[middle : middle + 2] = False
    found = estimator(flying)(measured(q)).apexes[0]
    assert len(found) == 1
    np.testing.assert_allclose(found[0, 1], 0.36, atol=0.004)


def test_drag_lowers_apexes():
    q, _, flying = flying_leg([0.33])
    one, data = estimator(flying), measured(q)
    free = one(data).apexes[0][0, 1]
    one.drag = np.array([0.005, 0.0])
    np.testing.assert_allclose(free - one(data).apexes[0][0, 1], 0.005)
