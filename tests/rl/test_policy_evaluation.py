"""How policies are ranked after their trials."""

import dataclasses

import pytest

from hopping_leg.rl.policy_evaluation import CommandResult, command_score, score

USUAL = {
    "median_error_m": 0.001, "std_m": 0.003, "hops": 300, "hops_per_s": 2.3, "flight_fraction": 0.6,
    "skipped_hops": 0, "body_contact_ticks": 0, "min_height_m": 0.1,
}  # fmt: skip
CALM = [CommandResult(command_m=command, **USUAL) for command in (0.25, 0.30, 0.35)]


def changed(**values):
    """Return the trials with something else at the lowest command."""
    return [dataclasses.replace(CALM[0], **values), *CALM[1:]]


def test_a_score_is_the_mean_of_error_and_scatter():
    assert score(CALM) == pytest.approx(0.004)


@pytest.mark.parametrize("fault", ["skipped_hops", "body_contact_ticks"])
def test_who_fails_once_in_hundreds_of_hops_loses_to_who_scatters_a_little_more(fault):
    wider = [dataclasses.replace(v, std_m=0.005) for v in CALM]
    assert score(CALM) < score(wider) < score(changed(**{fault: 1}))


def test_failing_more_often_is_worse():
    assert score(changed(skipped_hops=1)) < score(changed(skipped_hops=30))


def test_heights_out_of_order_are_worse_than_any_scatter():
    wide = [dataclasses.replace(v, std_m=0.03) for v in CALM]
    assert score(wide) < score(changed(median_error_m=0.06))


def test_a_command_without_hops_is_a_metre_off():
    assert command_score(dataclasses.replace(CALM[0], hops=0, std_m=float("nan"))) == 1.0
