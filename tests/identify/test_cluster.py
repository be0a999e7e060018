import pickle

import numpy as np
import pytest

from hopping_leg.identify.cluster import Cluster, split_population
from hopping_leg.identify.cost import Scoring
from hopping_leg.identify.leg_hypothesis import LegHypothesis
from hopping_leg.identify.objective import Objective
from hopping_leg.identify.parameters import choose
from hopping_leg.identify.windows import cut
from tests.clusters import two_machines
from tests.identify.twin import LEG, STEP, record, swing

RUN = record(LEG, swing(0.5))
PARAMETERS = choose(LegHypothesis(LEG), ["hip.friction", "knee.damping"])
VECTORS = np.random.default_rng(0).uniform(0, 1, (5, 2))


def objective():
    windows = tuple(cut([RUN], 0.25))
    return Objective((RUN,), windows, PARAMETERS, Scoring(), STEP, threads=1)


def test_a_population_in_parts_gets_the_same_costs():
    whole = objective()(VECTORS)
    parts = [objective()(part) for part in split_population(VECTORS, 3)]
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
        spread = Cluster(goal, address)
        assert spread.workers == 2
        np.testing.assert_array_equal(spread(VECTORS), goal(VECTORS))
        residuals = Cluster(goal.residuals, address)
        np.testing.assert_array_equal(residuals(VECTORS), goal.residuals(VECTORS))
