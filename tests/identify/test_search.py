import pickle

import numpy as np
import pytest

from hopping_leg.identify.cost import Objective, Scoring
from hopping_leg.identify.optimizers import CmaOptions, Found
from hopping_leg.identify.parameters import LegHypothesis, choose
from hopping_leg.identify.plan import make_plan, pass_names
from hopping_leg.identify.recording import make_recording
from hopping_leg.identify.search import (
    Searcher,
    SearchOptions,
    second_pass,
)
from hopping_leg.identify.windows import cut
from hopping_leg.workers import RayWorkers, map_rows
from tests.clusters import two_machines
from tests.identify.searches import CAD, TRUTH
from tests.identify.searches import RUN as TWIN_RUN
from tests.identify.twin import LEG, STEP, record, swing

RUN = record(LEG, swing(0.5))
PARAMETERS = choose(LegHypothesis(LEG), ["hip.friction", "knee.damping"])
VECTORS = np.random.default_rng(0).uniform(0, 1, (5, 2))


def objective():
    windows = tuple(cut([RUN], 0.25))
    return Objective((RUN,), windows, PARAMETERS, Scoring(), STEP, threads=1)


def test_a_population_in_parts_gets_the_same_costs():
    whole = objective()(VECTORS)
    parts = [objective()(part) for part in np.array_split(VECTORS, 3)]
    np.testing.assert_array_equal(np.concatenate(parts), whole)


def test_an_objective_that_was_used_can_be_sent():
    here = objective()
    costs = here(VECTORS)
    there = pickle.loads(pickle.dumps(here))
    np.testing.assert_array_equal(there(VECTORS), costs)


@pytest.mark.slow
def test_machines_of_a_cluster_give_the_same_bits():
    pytest.importorskip("ray", reason="Ray is not installed (extra 'cluster')")
    goal = objective()
    with two_machines() as address:
        workers = RayWorkers(address)
        for function in (goal, goal.residuals):
            there = map_rows(workers, function, VECTORS)
            np.testing.assert_array_equal(there, function(VECTORS))


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


def noisy(run):
    """Return the run as seen by poor sensors, so that windows disagree."""
    rng = np.random.default_rng(0)
    table = run.trace.table.with_columns(
        run.trace.table[f"{joint}_position_rad"] + rng.normal(scale=1e-3, size=len(run))
        for joint in ("hip", "knee")
    )
    return make_recording(table, run.metadata, "noisy")


def test_shares_of_the_windows_find_more_in_the_same_time():
    parameters = choose(CAD, list(TRUTH))
    run = noisy(TWIN_RUN)
    goal = Objective((run,), tuple(cut([run], 0.1)), parameters, Scoring(), STEP)
    plan = make_plan([run], LEG, parameters=tuple(TRUTH), search="cma")
    ends = []
    for generations, seconds in ((5, np.inf), (20, 0.5)):
        options = SearchOptions(cma=CmaOptions(generations, 10, seconds=seconds))
        searcher = Searcher(plan, goal, options, 0, None, lambda *progress: None, None, {})
        ends.append(searcher.run(["fixed-base"])[0].found)
    whole, shared = ends
    assert shared.cost == goal(shared.vector[None])[0]
    assert shared.cost < 0.5 * whole.cost
