"""Scores are shares of successes, intervals hold them, failures are what they are said to be."""

import pytest

from hopping_leg.evaluate.robustness.outcome import Outcome, level_rows, score_rows, share


def outcome(level, error=0.0, skipped=0, contacts=0, repeat=0, missed=False):
    return Outcome(level, 0.3, repeat, error, missed, skipped, contacts)


def trials(level, *, success, count=4, repeat=0):
    return [outcome(level, 0.0 if success else 0.1, repeat=repeat)] * count


def test_success_needs_every_hop_and_the_right_height():
    assert outcome(1, 0.02).success
    assert outcome(1, -0.02).success
    assert not outcome(1, 0.0201).success
    assert not outcome(1, 0.0, skipped=1).success
    assert not outcome(1, 0.0, missed=True).success


def test_the_share_counts_every_axis_and_level_alike():
    many, few = trials(0.1, success=True, count=30), trials(0.2, success=False, count=2)
    assert share([[*many, *few]], 0)[0] == pytest.approx(0.5)
    more = trials(0.3, success=False)
    assert share([[*many, *few, *more], many], 0)[0] == pytest.approx((1 / 3 + 1) / 2)


def test_the_interval_is_over_realisations_not_over_trials():
    def of(wins):
        return [one for r, win in enumerate(wins) for one in trials(0.1, success=win, repeat=r)]

    score, low, high = share([of([True, False, True])], 1)
    assert score == pytest.approx(2 / 3)
    assert share([of([True, False, True])], 1) == (score, low, high)
    more = [one for one in of([True, False, True]) for _ in range(10)]
    assert share([more], 1) == (score, low, high), "more trials of a realisation tell no more"
    assert high - low > 0.5
    many = share([of([True, False, True] * 20)], 1)
    assert many[2] - many[1] < 0.3
    _, low, high = share([of([True] * 3)], 0)
    assert low < 0.75 < high == 1, "three that agree are no certainty"
    good = [trials(0.1, success=True, repeat=r) for r in range(20)]
    bad = [trials(0.2, success=False, repeat=r) for r in range(20)]
    steady = [one for group in (*good, *bad) for one in group]
    score, low, high = share([steady], 0)
    assert score == 0.5, "levels are chosen, not drawn: their difference is no scatter"
    assert high - low < 0.2


def test_rows_tell_levels_axes_and_the_mean():
    good = [outcome(0.1), outcome(0.1, 0.01)]
    bad = [outcome(0.2, -0.05, contacts=3), outcome(0.2, -0.09, skipped=4, missed=True)]
    levels = level_rows("mine", "delay", [*bad, *good])
    assert [row["level"] for row in levels] == [0.1, 0.2]
    assert [row["success"] for row in levels] == [1.0, 0.0]
    assert levels[0]["median_abs_error_m"] == pytest.approx(0.005)
    assert levels[1]["median_abs_error_m"] == pytest.approx(0.07)
    assert [row["missed"] for row in levels] == [0, 1]
    assert (levels[1]["skipped_hops"], levels[1]["body_contacts"]) == (4, 3)
    rows = score_rows("mine", {"delay": [*good, *bad], "links": good}, 0)
    assert [(row["axis"], row["score"], row["trials"]) for row in rows] == [
        ("delay", 0.5, 4),
        ("links", 1.0, 2),
        ("overall", 0.75, 6),
    ]
