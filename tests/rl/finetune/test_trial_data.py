"""Trials are read from traces, and apexes are found afterwards from the joints alone."""

import numpy as np
import pytest

from hopping_leg.controllers.command_schedule import CommandSchedule
from hopping_leg.errors import TraceError
from hopping_leg.rl.finetune.trial_data import TrialData
from hopping_leg.trace import Trace

from .trials import PERIOD, Imagined, estimator, flying_leg


@pytest.fixture(scope="module")
def trace():
    schedule = CommandSchedule(((0.25, 0.5),))
    return Imagined().hop(None, schedule, 0).trace


def changed(trace, **columns):
    return Trace(trace.table.with_columns(**columns), trace.header)


def test_a_sample_that_did_not_arrive_is_the_one_before(trace):
    q = trace.column("hip_position_rad").copy()
    q[[0, 50]] = np.nan
    filled = TrialData.of([changed(trace, hip_position_rad=q)]).filled()[:, 0, 0]
    assert filled[0] == q[1]
    assert filled[50] == q[49]
    np.testing.assert_array_equal(np.delete(filled, [0, 50]), np.delete(q, [0, 50]))


def test_a_trace_without_samples_is_refused(trace):
    nothing = np.full(trace.table.height, np.nan)
    empty = changed(trace, hip_position_rad=nothing, knee_position_rad=nothing)
    with pytest.raises(TraceError, match="no sample"):
        TrialData.of([empty])


def measured(q):
    nothing = np.zeros_like(q)
    return TrialData(q, nothing, nothing, np.full((len(q), 1), 0.3), PERIOD)


def test_apexes_of_a_stone_are_found_within_the_clocks_resolution():
    q, height, flying = flying_leg([0.28, 0.33, 0.38])
    (found,) = estimator(flying)(measured(q))
    np.testing.assert_allclose(found[:, 1], [0.28, 0.33, 0.38], atol=0.004)
    np.testing.assert_allclose(height[found[:, 0].astype(int)], found[:, 1], atol=0.006)


def test_a_flicker_of_contact_does_not_cut_a_flight():
    q, _, flying = flying_leg([0.36])
    middle = int(np.flatnonzero(flying).mean())
    flying[middle : middle + 2] = False
    (found,) = estimator(flying)(measured(q))
    assert len(found) == 1
    np.testing.assert_allclose(found[0, 1], 0.36, atol=0.004)


def test_drag_lowers_apexes():
    q, _, flying = flying_leg([0.33])
    one, data = estimator(flying), measured(q)
    free = one(data)[0][0, 1]
    one.drag = np.array([0.005, 0.0])
    np.testing.assert_allclose(free - one(data)[0][0, 1], 0.005)
