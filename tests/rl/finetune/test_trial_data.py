"""What a policy was shown is rebuilt from a trace exactly."""

import numpy as np
import pytest

from hopping_leg.controllers import RolloutConfig, rollout
from hopping_leg.controllers.observation_history import make_observation_history
from hopping_leg.errors import TraceError
from hopping_leg.rl.finetune.simulated import Witness, traces_of
from hopping_leg.rl.finetune.trial_data import TrialData
from hopping_leg.sim import NO_NOISE
from hopping_leg.trace import Trace

from .trials import PERIOD, POLICY, ROBOT, estimator, flying_leg


class Shown:
    """A policy that remembers every input of its network."""

    name = "shown"

    def __init__(self):
        self.layout = make_observation_history(POLICY.card.layout, PERIOD)

    def reset(self, count):
        POLICY.reset(count)
        self.layout.reset(count)
        self.seen, self.torque = [], np.zeros((count, 2))

    def act(self, measurement):
        self.layout.update(measurement, self.torque)
        self.seen.append({k: v.copy() for k, v in self.layout.inputs().items()})
        self.torque = POLICY.act(measurement)
        return self.torque

    def internals(self):
        return {}


@pytest.fixture(scope="module")
def run():
    shown = Shown()
    witness = Witness(shown, None)
    commands = np.repeat([[0.25, 0.3], [0.35, 0.28]], 60, axis=0)
    setup = RolloutConfig(ROBOT, NO_NOISE, threads=1)
    return shown, traces_of(rollout(witness, setup, commands, 3, on_legs=witness.watch))


def test_inputs_rebuilt_from_traces_are_those_that_the_network_saw(run):
    shown, traces = run
    data = TrialData.of(traces)
    layout = make_observation_history(POLICY.card.layout, PERIOD)
    layout.reset(2)
    last = np.zeros((2, 2))
    for tick, measurement in enumerate(data.measurements()):
        layout.update(measurement, last)
        for name, values in layout.inputs().items():
            np.testing.assert_array_equal(values, shown.seen[tick][name], err_msg=name)
        last = data.asked[tick]


def test_a_sample_that_did_not_arrive_shows_the_ones_before_with_their_age(run):
    table = run[1][0].table
    rows = np.arange(table.height)
    gap = table.with_columns(
        hip_position_rad=np.where(rows == 50, np.nan, table["hip_position_rad"].to_numpy())
    )
    data = TrialData.of([Trace(gap, run[1][0].header)])
    seen = list(data.measurements())
    np.testing.assert_allclose(seen[50].age[0], PERIOD * np.array([1, 2, 3]))
    np.testing.assert_allclose(seen[51].age[0], PERIOD * np.array([0, 2, 3]))
    np.testing.assert_array_equal(seen[50].q[0, 0], data.q[49, 0])
    assert np.isfinite(data.filled()).all()


def test_a_trace_without_samples_is_refused(run):
    table = run[1][0].table
    nothing = np.full(table.height, np.nan)
    empty = table.with_columns(hip_position_rad=nothing, knee_position_rad=nothing)
    with pytest.raises(TraceError, match="no sample"):
        TrialData.of([Trace(empty, run[1][0].header)])


def measured(q):
    nothing = np.zeros_like(q)
    return TrialData(q, nothing, nothing, nothing, np.full((len(q), 1), 0.3), PERIOD)


def estimate(hops):
    q, height, flying = flying_leg(hops)
    return estimator(flying)(measured(q)), height, flying


def test_apexes_of_a_stone_are_found_within_the_clocks_resolution():
    found, _, _ = estimate([0.28, 0.33, 0.38])
    np.testing.assert_allclose(found.apexes[0][:, 1], [0.28, 0.33, 0.38], atol=0.004)


def test_height_and_flight_follow_the_parabola():
    found, height, flying = estimate([0.33])
    np.testing.assert_allclose(found.height[:, 0], height, atol=0.008)
    assert (found.flying[:, 0] != flying).sum() <= 2


def test_a_flicker_of_contact_does_not_cut_a_flight():
    q, _, flying = flying_leg([0.36])
    middle = int(np.flatnonzero(flying).mean())
    flying[middle : middle + 2] = False
    found = estimator(flying)(measured(q)).apexes[0]
    assert len(found) == 1
    np.testing.assert_allclose(found[0, 1], 0.36, atol=0.004)


def test_drag_lowers_apexes():
    q, _, flying = flying_leg([0.33])
    one, data = estimator(flying), measured(q)
    free = one(data).apexes[0][0, 1]
    one.drag = np.array([0.005, 0.0])
    np.testing.assert_allclose(free - one(data).apexes[0][0, 1], 0.005)
