import pickle

import numpy as np
import pytest

from hopping_leg.identify.cost import Scoring
from hopping_leg.identify.optimizers import CmaOptions, Found
from hopping_leg.identify.parameters import choose
from hopping_leg.identify.plan import make_plan, pass_names
from hopping_leg.identify.search import Searcher, SearchOptions, second_pass
from tests.identify.searches import CAD, RUN, TRUTH, objective
from tests.identify.twin import LEG, noisy

VECTORS = np.random.default_rng(0).uniform(0, 1, (5, 2))


def test_an_objective_that_was_used_can_be_sent():
    here = objective()
    costs = here(VECTORS)
    there = pickle.loads(pickle.dumps(here))
    np.testing.assert_array_equal(there(VECTORS), costs)


def test_the_second_pass_stays_near_the_first():
    rigs = ["fixed-base", "rail"]
    first = choose(CAD, pass_names(rigs)[0])
    assert "thigh.inertia" not in first.names
    vector = np.clip(np.ones(len(first.names)), *first.bounds)
    second = second_pass(first, Found(vector, 1.0, 1, []), rigs, {}, {})
    assert {"thigh.inertia", "contact.time_constant", "rail.damping"} <= set(second.names)
    found = dict(zip(first.names, first.values(vector), strict=True))
    for p in second.parameters:
        if p.name in found:
            assert p.start == pytest.approx(found[p.name])
            assert p.low == 0 or p.low >= 0.49 * p.start - p.scale


def test_shares_of_the_windows_find_more_in_the_same_time():
    run = noisy(RUN, position_rad=1e-3)  # so that windows disagree
    goal = objective(choose(CAD, list(TRUTH)), Scoring(), [run], 0.1)
    plan = make_plan([run], LEG, parameters=tuple(TRUTH), search="cma")
    ends = []
    for generations, seconds in ((5, np.inf), (20, 0.5)):
        options = SearchOptions(cma=CmaOptions(generations, 10, seconds=seconds))
        searcher = Searcher(plan, goal, options, 0, None, lambda *progress: None, None, {})
        ends.append(searcher.run(["fixed-base"])[0].found)
    whole, shared = ends
    assert shared.cost == goal(shared.vector[None])[0]
    assert shared.cost < 0.5 * whole.cost
