import itertools

import numpy as np
import pytest
from scipy import stats

from hopping_leg.evaluate.statistics import cliffs_delta, compare, median_interval


def test_cliffs_delta_counts_pairs():
    rng = np.random.default_rng(0)
    lower, upper = rng.normal(0, 1, 30), rng.normal(0.5, 1, 20)
    lower[:5] = upper[:5]
    pairs = [np.sign(u - v) for u, v in itertools.product(upper, lower)]
    assert cliffs_delta(lower, upper) == pytest.approx(np.mean(pairs))


def test_separated_distributions():
    result = compare(0.25, np.linspace(0.24, 0.26, 50), 0.30, np.linspace(0.29, 0.31, 50))
    assert result.cliffs_delta == 1
    assert result.overlap == 0
    assert result.p < 1e-3


def test_the_p_value_is_the_rank_sum_tests():
    rng = np.random.default_rng(1)
    lower, upper = rng.normal(0, 1, 40), rng.normal(0.3, 1, 40)
    assert compare(0, lower, 1, upper).p == stats.ranksums(lower, upper).pvalue


def test_no_hops_give_no_numbers():
    assert np.isnan(compare(0.25, np.empty(0), 0.3, np.ones(3)).p)
    assert np.isnan(median_interval([np.empty(0)], 0)).all()


def test_the_interval_covers_the_median_as_often_as_promised():
    rng = np.random.default_rng(2)
    inside = 0
    for trial in range(100):
        runs = list(rng.normal(0, 1, (12, 10)))
        low, high = median_interval(runs, trial, resamples=200)
        inside += low <= 0 <= high
    assert inside >= 85


def test_runs_that_differ_widen_the_interval():
    rng = np.random.default_rng(3)
    hops = rng.normal(0, 1, (10, 30))
    offsets = rng.normal(0, 3, (10, 1))
    narrow, wide = median_interval(list(hops), 0), median_interval(list(hops + offsets), 0)
    assert narrow == median_interval(list(hops), 0)
    assert wide[1] - wide[0] > 3 * (narrow[1] - narrow[0])
