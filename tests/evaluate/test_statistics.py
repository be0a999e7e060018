import dataclasses

import numpy as np
import pytest
from scipy import stats

from hopping_leg.evaluate import statistics
from hopping_leg.evaluate.metrics import errors_of
from hopping_leg.evaluate.statistics import cliffs_delta, compare, median_interval
from tests.evaluate.test_metrics import sine_trace, window_of


def test_cliffs_delta_counts_pairs():
    lower, upper = np.array([1.0, 2.0, 4.0]), np.array([2.0, 3.0])
    assert cliffs_delta(lower, upper) == pytest.approx((3 - 2) / 6)  # one pair is tied


def test_runs_with_offsets_of_their_own_are_not_taken_for_one_sample():
    rng = np.random.default_rng(4)
    offsets = rng.normal(0, 3, (6, 1))
    lower, upper = rng.normal(0, 1, (6, 50)) + offsets, rng.normal(0.8, 1, (6, 50)) + offsets
    within = compare(0, list(lower), 1, list(upper), 0)
    assert within.p < 1e-10 < within.pooled_p, "what differs within every run is seen"
    opposed = compare(0, [lower[0], upper[0]], 1, [upper[0], lower[0]], 0)
    assert opposed.p > 0.9, "runs that contradict each other cancel"
    assert opposed.cliffs_delta == pytest.approx(0, abs=1e-12)
    apart = compare(0, [np.arange(9.0)] * 2, 1, [np.arange(9.0) + 20] * 2, 0)
    assert apart.cliffs_delta == apart.cliffs_delta_low == apart.cliffs_delta_high == 1
    assert (apart.overlap, apart.runs) == (0, 2)


def test_the_combined_p_value_is_uniform_where_nothing_differs():
    rng = np.random.default_rng(5)
    p = [compare(0, list(rng.normal(0, 1, (5, 30))), 1, list(rng.normal(0, 1, (5, 30))), 0).p
         for _ in range(200)]  # fmt: skip
    assert stats.kstest(p, "uniform").pvalue > 0.01


def test_too_few_give_no_numbers():
    none = compare(0.25, [np.empty(0)], 0.3, [np.ones(3)], 0)
    assert none.runs == 0
    assert np.isnan([none.p, none.cliffs_delta, none.pooled_p]).all()
    assert np.isnan(median_interval([np.empty(0)], 0)).all()
    twins = list(np.random.default_rng(0).normal(0, 1, (20, 3)))
    assert np.isfinite(median_interval(twins, 0, 20)).all()
    assert np.isnan(median_interval(twins[1:], 0, 20)).all(), "units below the least"


def test_a_run_without_hops_is_a_miss_as_often_as_others_hop():
    def window(hops, settled, standing=0.2):
        apex, known = np.full(hops, 0.3), window_of(sine_trace())
        changes = {"apex": apex, "settled": settled, "standing": standing, "command": 0.3}
        return dataclasses.replace(known, **changes)

    still = window(0, 4.0, 0.1)
    filled = errors_of([window(30, 15.0), window(0, 15.0), window(20, 10.0), still])
    assert [len(run) for run in filled] == [30, 30, 20, 8]
    assert filled[1] == pytest.approx(-0.1)
    assert filled[3] == pytest.approx(-0.2)
    assert errors_of([still])[0] == pytest.approx([-0.2])


def test_the_interval_covers_the_median_as_often_as_promised():
    rng = np.random.default_rng(2)
    inside = 0
    for trial in range(60):
        runs = list(rng.normal(0, 1, (12, 10)))
        low, high = median_interval(runs, trial)
        inside += low <= 0 <= high
    assert inside >= 51


def test_realisations_that_agree_are_no_certainty():
    low, high = statistics.share_interval(np.ones(3), 0)
    assert high == 1
    assert low < 0.7
    jeffreys = stats.beta(10.5, 10.5).ppf([0.025, 0.975])
    coins = np.repeat([0.0, 1.0], 10)
    assert statistics.share_interval(coins, 0) == pytest.approx(jeffreys, abs=0.01)
    assert np.ptp(statistics.share_interval(np.full(20, 0.5), 0)) < np.ptp(jeffreys) / 2
