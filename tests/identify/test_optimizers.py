import dataclasses
import pickle

import numpy as np
import pytest

from hopping_leg.identify.optimizers import (
    Found,
    Pass,
    SearchOptions,
    cma_es,
    deal,
    jacobian,
    least_squares,
    second_pass,
)
from hopping_leg.identify.parameters import choose
from hopping_leg.identify.plan import pass_names
from tests.identify.searches import BOTTOM, CAD, RUN, SCORING, TRUTH, TWO, bowl, objective
from tests.identify.twin import record, swing


def squares(vectors):
    return np.square(bowl(vectors)).sum(1)


def test_cma_es_finds_the_bottom_of_a_bowl_and_by_shares_ends_where_they_agree():
    found = cma_es(squares, TWO, SearchOptions(generations=60), seed=3)
    np.testing.assert_allclose(found.vector, BOTTOM, atol=1e-4)
    assert found.history == sorted(found.history, reverse=True)
    shared = cma_es(
        squares, TWO, SearchOptions(generations=500), seed=3, shares=[lambda v: squares(v) / 2] * 2
    )
    assert len(shared.history) < 100
    np.testing.assert_allclose(shared.vector, BOTTOM, atol=3e-3)


@pytest.mark.parametrize("groups", [None, np.arange(2)], ids=["one-sided", "two-sided"])
def test_differences_stay_inside_the_bounds(groups):
    low, high = TWO.bounds
    for start in (low, high, 0.5 * (low + high)):
        seen = []
        slopes = jacobian(lambda v, s=seen: s.append(v) or bowl(v), start, (low, high), groups)
        assert (np.concatenate(seen) >= low).all()
        assert (np.concatenate(seen) <= high).all()
        np.testing.assert_allclose(slopes, np.array([[2.0, 0.3], [0.1, 1.0]]).T, rtol=1e-6)


def test_slopes_do_not_take_a_jump_for_a_slope():
    groups = np.array([0, 1])
    bounds = (np.full(1, -1.0), np.full(1, 1.0))

    def jumping(vectors):
        jump = np.where(vectors > 2e-4, 0.5, 0.0)
        return np.concatenate([3 * vectors + jump, 2 * vectors], axis=1)

    for start in (0.0, 3e-4, 1.0, -1.0):
        slopes = jacobian(jumping, np.array([start]), bounds, groups)
        np.testing.assert_allclose(slopes, [[3.0], [2.0]], rtol=1e-6)
    assert jacobian(jumping, np.zeros(1), bounds)[0, 0] > 100


def test_a_recording_that_the_model_cannot_explain_hardly_moves_the_estimate():
    weak = CAD.replace({**TRUTH, "knee.motor.torque_limit": 0.3}).robot
    run = record(weak, swing(2.0, phase=1.0))

    def errors(scoring, recordings, **more):
        parameters = choose(CAD.replace(dict.fromkeys(more, 0.8)), [*TRUTH, *more])
        goal = objective(parameters, scoring, recordings)
        found = least_squares(goal.residuals, parameters, goal.loss)
        return np.abs(parameters.values(found.vector) / [*(TRUTH | more).values()] - 1)

    assert errors(SCORING, [RUN, run]).max() > 0.5
    robust = dataclasses.replace(SCORING, unexplained=1.0)
    assert errors(robust, [RUN, run]).max() < 0.02
    whole = dataclasses.replace(robust, in_full=("position",))
    assert errors(whole, [RUN, run]).max() > 0.1
    limit = {"drive.knee.torque_limit": weak.knee.torque_limit}  # which explains it
    assert errors(SCORING, [run], **limit).max() < 0.02


def test_steps_follow_the_slope_of_the_levelled_cost():
    goal = objective(TWO, dataclasses.replace(SCORING, unexplained=1.0))
    vector, shift = np.array([0.5, -0.5]), 1e-4 * np.eye(2)
    residuals = goal.residuals(vector[None])[0]
    weights = goal.loss.weights(residuals)
    assert weights.min() < 0.1
    slopes = jacobian(goal.residuals, vector, TWO.bounds, step=1e-4)
    expected = (goal(vector + shift) - goal(vector - shift)) / 2e-4
    np.testing.assert_allclose(2 * (weights**2 * residuals) @ slopes, expected, rtol=1e-3)


VECTORS = np.random.default_rng(0).uniform(0, 1, (5, 2))


def test_an_objective_that_was_used_can_be_sent():
    here = objective()
    costs = here(VECTORS)
    there = pickle.loads(pickle.dumps(here))
    np.testing.assert_array_equal(there(VECTORS), costs)


def test_the_second_pass_stays_near_the_first():
    names, added = pass_names(["fixed-base", "rail"])
    first, every = choose(CAD, names), choose(CAD, names + added)
    vector = np.clip(np.ones(len(first.names)), *first.bounds)
    second = second_pass(every, Pass("first", first, Found(vector, 1.0, 1, [])))
    assert second.names == every.names
    found = dict(zip(first.names, first.values(vector), strict=True))
    for p in second.parameters:
        if p.name in found:
            assert p.start == pytest.approx(found[p.name])
            assert p.low == 0 or p.low >= 0.49 * p.start - p.scale


def test_dealt_windows_are_all_there_and_every_share_is_spread_over_them():
    goal = objective(length=0.1)
    shares = deal(goal, 0.5, np.random.default_rng(0))
    assert sorted((w for share in shares for w in share), key=lambda w: w.start) == [*goal.windows]
    for share in shares:
        assert [w.start // 80 for w in share] == list(range(len(share)))
        assert len({w.start % 80 for w in share}) > 1
    assert deal(goal, 3.0, np.random.default_rng(0)) == []
