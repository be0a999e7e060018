import dataclasses

import numpy as np
import pytest

from hopping_leg.evaluate.aggregation import pool_group

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


def test_a_policy_that_never_hops_is_counted_but_has_no_error(rows):
    silent = dataclasses.replace(rows[0], median_error_m=np.nan, std_m=np.nan)
    (group,) = pool_group("fast", [silent, *rows[1:]], 0)
    assert (group.policies, group.motionless) == (3, 1)
    assert group.median_error_m == pytest.approx(0.002)
    (nothing,) = pool_group("fast", [silent], 0)
    assert np.isnan(nothing.median_error_m)
