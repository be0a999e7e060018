import numpy as np
import pytest

from hopping_leg.errors import UsageError
from hopping_leg.identify.cma import CmaOptions, cma_es
from hopping_leg.identify.cost import Scoring
from hopping_leg.identify.objective import Objective
from hopping_leg.identify.optimizers import Searcher, SearchOptions
from hopping_leg.identify.parameters import choose
from hopping_leg.identify.plan import make_plan
from hopping_leg.identify.recording import make_recording
from hopping_leg.identify.windows import cut
from tests.identify.searches import BOTTOM, CAD, RUN, TRUTH, TWO, bowl, killed
from tests.identify.twin import LEG, STEP


def test_cma_es_finds_the_bottom_of_a_bowl():
    found = cma_es(lambda v: np.square(bowl(v)).sum(1), TWO, CmaOptions(60), seed=3)
    np.testing.assert_allclose(found.vector, [1.0, -0.5], atol=1e-4)
    assert found.history == sorted(found.history, reverse=True)


SHIFTS = 0.3 * np.random.default_rng(0).normal(size=(5, 2))
SHIFTS -= SHIFTS.mean(axis=0)
SHARES = [
    lambda vectors, shift=shift: np.square(bowl(vectors - shift)).sum(1) / len(SHIFTS)
    for shift in SHIFTS
]
"""Bowls with different bottoms, that of their sum at (1, -0.5)."""


def sum_of_shares(vectors):
    return sum(share(vectors) for share in SHARES)


def test_shares_in_turn_find_the_bottom_of_their_sum():
    found = cma_es(sum_of_shares, TWO, CmaOptions(80), seed=3, shares=SHARES)
    assert found.cost == sum_of_shares(found.vector[None])[0] == found.history[-1]
    own = sum_of_shares(SHIFTS + BOTTOM)
    (least,) = sum_of_shares(BOTTOM[None])
    assert found.cost - least < 0.05 * (own.mean() - least)


def test_a_share_judges_a_generation_and_the_whole_only_the_last_ones():
    counted = {"share": 0, "whole": 0}

    def count(name, function):
        def run(vectors):
            counted[name] += len(vectors)
            return function(vectors)

        return run

    shares = [count("share", share) for share in SHARES]
    cma_es(count("whole", sum_of_shares), TWO, CmaOptions(20), seed=0, shares=shares)
    assert counted["share"] == 20 * 16
    assert 0 < counted["whole"] < 16


def test_a_search_by_shares_ends_where_they_agree():
    share = [lambda vectors: np.square(bowl(vectors)).sum(1) / 2] * 2
    found = cma_es(lambda v: np.square(bowl(v)).sum(1), TWO, CmaOptions(500), seed=3, shares=share)
    assert len(found.history) < 100
    np.testing.assert_allclose(found.vector, [1.0, -0.5], atol=3e-3)


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
    run = noisy(RUN)
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


def test_a_killed_cma_es_resumes_exactly(tmp_path):
    def values(vectors):
        return np.square(bowl(vectors)).sum(1)

    options = CmaOptions(20, population=6)
    whole = cma_es(values, TWO, options, seed=1)
    file = tmp_path / "state.json"
    with pytest.raises(KeyboardInterrupt):
        cma_es(killed(values, 7), TWO, options, seed=1, checkpoint=file)
    counted = []
    resumed = cma_es(
        lambda v: counted.append(1) or values(v), TWO, options, seed=1, checkpoint=file
    )
    assert len(counted) == 13
    assert resumed.history == whole.history
    np.testing.assert_array_equal(resumed.vector, whole.vector)
    with pytest.raises(UsageError, match="belongs to a search with other"):
        cma_es(values, TWO, options, seed=2, checkpoint=file)


def test_a_killed_search_by_shares_resumes_exactly(tmp_path):
    options = CmaOptions(20, population=6)
    whole = cma_es(sum_of_shares, TWO, options, seed=1, shares=SHARES)
    file = tmp_path / "state.json"
    broken = [killed(share, 2) for share in SHARES]
    with pytest.raises(KeyboardInterrupt):
        cma_es(sum_of_shares, TWO, options, seed=1, shares=broken, checkpoint=file)
    resumed = cma_es(sum_of_shares, TWO, options, seed=1, shares=SHARES, checkpoint=file)
    assert resumed.history == whole.history
    np.testing.assert_array_equal(resumed.vector, whole.vector)
