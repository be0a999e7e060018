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

from .trials import PERIOD, POLICY, ROBOT


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
