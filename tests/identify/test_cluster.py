import builtins
import pickle

import numpy as np
import pytest

from hopping_leg.errors import UsageError
from hopping_leg.identify.candidate import Candidate
from hopping_leg.identify.cluster import Cluster, split_population
from hopping_leg.identify.cost import Scoring
from hopping_leg.identify.objective import Objective
from hopping_leg.identify.parameters import choose
from hopping_leg.identify.windows import cut
from tests.identify.twin import LEG, STEP, record, swing

RUN = record(LEG, swing(0.5))
PARAMETERS = choose(Candidate(LEG), ["hip.friction", "knee.damping"])
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


def test_a_cluster_gives_the_same_bits():
    pytest.importorskip("ray", reason="Ray is not installed (extra 'cluster')")
    goal = objective()
    np.testing.assert_array_equal(Cluster(goal, workers=2)(VECTORS), goal(VECTORS))


def test_where_no_cluster_answers_there_is_a_sentence_at_once():
    ray = pytest.importorskip("ray", reason="Ray is not installed (extra 'cluster')")
    if ray.is_initialized():
        ray.shutdown()
    with pytest.raises(UsageError, match=r"no Ray cluster at 127\.0\.0\.1:1: .*; start one"):
        Cluster(objective(), address="127.0.0.1:1")


def test_without_ray_there_is_a_sentence(monkeypatch):
    real = builtins.__import__

    def refuse(name, *rest, **more):
        if name == "ray":
            raise ModuleNotFoundError(name)
        return real(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", refuse)
    with pytest.raises(UsageError, match=r"hopping-leg\[cluster\]"):
        Cluster(objective())
