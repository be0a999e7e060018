import pytest

from studies.fault_campaign.families import FAMILIES
from studies.fault_campaign.safety_case import rows, upper_bound


def test_a_bound_of_a_rate_without_failures_is_that_of_the_binomial_distribution():
    assert upper_bound(3000, 0) == pytest.approx(3 / 3000, rel=2e-3)
    for trials in (1, 20, 3000):
        assert (1 - upper_bound(trials, 0)) ** trials == pytest.approx(0.05)
    assert upper_bound(0, 0) is None
    assert upper_bound(100, 1) is None


def test_every_family_has_a_row_that_says_what_notices_it_and_what_follows():
    stored = {"family": "total loss", "trials": 30, "unsafe": 0, "reaction_p99_s": 0.02}
    case = {row["fault"]: row for row in rows({"rows": [{**stored, "braked_max_s": None}]})}
    assert list(case) == list(FAMILIES)
    assert all(row["noticed_by"] and row["follows"] for row in case.values())
    assert case["total loss"]["noticed_by"] == "A drive did not answer in several ticks."
    assert case["total loss"]["upper_bound"] == pytest.approx(0.095, abs=0.001)
    assert case["wrong configuration"]["follows"] == "the leg is not armed"
    assert case["wrong wiring"]["follows"] == "the leg does not hop"
    assert case["duplicated reply"]["follows"] == "it hops on"
    assert case["drive fault"]["trials"] == 0
