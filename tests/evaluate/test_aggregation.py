import dataclasses

import numpy as np
import pytest

from hopping_leg.evaluate.aggregation import pool_group, summarise
from hopping_leg.evaluate.metrics import measure
from tests.evaluate.test_metrics import sine_trace, with_column

ERRORS = (-0.004, 0.001, 0.003)


@pytest.fixture
def rows(judged):
    """Rows of three policies at one command."""
    first = judged.evaluation.summary[0]
    return [
        dataclasses.replace(
            first, controller=f"p{i}", median_error_m=e, std_m=0.01, skipped_hops=1, body_contacts=2
        )
        for i, e in enumerate(ERRORS)
    ]


def test_policies_of_one_recipe_are_pooled(rows):
    (group,) = pool_group("fast", rows, 0)
    assert (group.group, group.policies, group.motionless) == ("fast", 3, 0)
    assert group.median_error_m == 0.001
    assert group.worst_abs_error_m == 0.004
    assert (group.skipped_hops, group.body_contacts) == (3, 6)
    assert ERRORS[0] <= group.median_error_low_m <= group.median_error_high_m <= ERRORS[-1]
    other = [dataclasses.replace(row, command_m=0.35, median_error_m=0.02) for row in rows]
    groups = pool_group("fast", rows + other, 0)
    assert [(g.command_m, g.median_error_m) for g in groups] == [(0.25, 0.001), (0.35, 0.02)]


def test_a_policy_that_never_hops_stays_as_a_miss(rows):
    silent = dataclasses.replace(rows[0], median_error_m=-0.05, std_m=np.nan, hops=0)
    (group,) = pool_group("fast", [silent, *rows[1:]], 0)
    assert (group.policies, group.motionless) == (3, 1)
    assert group.median_error_m == pytest.approx(0.001)
    assert group.worst_abs_error_m == 0.05
    assert group.median_error_low_m == -0.05
    (nothing,) = pool_group("fast", [silent], 0)
    assert (nothing.median_error_m, nothing.worst_abs_error_m) == (-0.05, 0.05)


def test_a_run_without_hops_stays_in_median_distance_and_interval():
    hopping, standing = sine_trace(), sine_trace()
    still = with_column(standing, "foot_clearance_m", np.zeros(len(standing.table)))
    (hops,), (none,) = measure(hopping), measure(still)
    assert none.miss == pytest.approx(0.21 - 0.30)
    row = summarise("c", 0.30, [hops, none, none], 0)
    assert (row.runs, row.missed_runs, row.hops) == (3, 2, len(hops.apex))
    assert row.median_error_m == pytest.approx(-0.09)
    assert row.mean_abs_error_m == pytest.approx((0.01 + 2 * 0.09) / 3, abs=1e-4)
    assert row.median_error_low_m == pytest.approx(-0.09)
    assert row.median_error_high_m == pytest.approx(0.01, abs=1e-4)
    assert row.std_m < 1e-3, "the spread is of the hops that there were"


def test_neighbours_are_compared_run_by_run(judged):
    (found,) = judged.evaluation.neighbours[0].neighbours
    assert found.runs == 4, "two fixed runs and two sequences"
    assert found.cliffs_delta_low <= found.cliffs_delta <= found.cliffs_delta_high
