"""Scores are shares of successes, intervals hold them, failures are what they are said to be."""

import numpy as np
import pytest

from hopping_leg.evaluate.robustness.outcome import Outcome, level_rows, score_rows, share


def outcome(level, error=0.0, skipped=0, contacts=0):
    return Outcome(level, 0.3, 0, error, skipped, contacts)


def test_success_needs_every_hop_and_the_right_height():
    assert outcome(1, 0.02).success
    assert outcome(1, -0.02).success
    assert not outcome(1, 0.0201).success
    assert not outcome(1, 0.0, skipped=1).success
    assert not outcome(1, None).success


def test_the_share_counts_every_axis_and_level_alike():
    many, few = np.ones(30), np.zeros(2)
    assert share([[many, few]], 0)[0] == pytest.approx(0.5)
    assert share([[many, few, few], [many]], 0)[0] == pytest.approx((1 / 3 + 1) / 2)


def test_the_interval_resamples_within_levels():
    rng = np.random.default_rng(0)
    certain = [np.ones(20), np.zeros(20)]
    assert share([certain], 0) == (0.5, 0.5, 0.5)
    coin = (rng.random(200) < 0.5).astype(float)
    score, low, high = share([[coin]], 1)
    expected = 1.96 * np.sqrt(score * (1 - score) / len(coin))
    assert score - low == pytest.approx(expected, rel=0.15)
    assert high - score == pytest.approx(expected, rel=0.15)
    assert share([[coin]], 1) == (score, low, high)
    narrower = share([[coin], certain], 1)
    assert narrower[2] - narrower[1] < high - low
    score, *interval = share([[np.ones(1), np.zeros(4)]], 0)  # one trial alone has none
    assert score == 0.5
    assert np.isnan(interval).all()


def test_rows_tell_levels_axes_and_the_mean():
    good = [outcome(0.1), outcome(0.1, 0.01)]
    bad = [outcome(0.2, -0.05, contacts=3), outcome(0.2, None, skipped=4)]
    levels = level_rows("mine", "delay", [*bad, *good])
    assert [row["level"] for row in levels] == [0.1, 0.2]
    assert [row["success"] for row in levels] == [1.0, 0.0]
    assert levels[0]["median_abs_error_m"] == pytest.approx(0.005)
    assert levels[1]["median_abs_error_m"] == pytest.approx(0.05)
    assert (levels[1]["skipped_hops"], levels[1]["body_contacts"]) == (4, 3)
    rows = score_rows("mine", {"delay": [*good, *bad], "links": good}, 0)
    assert [(row["axis"], row["score"], row["trials"]) for row in rows] == [
        ("delay", 0.5, 4),
        ("links", 1.0, 2),
        ("overall", 0.75, 6),
    ]
