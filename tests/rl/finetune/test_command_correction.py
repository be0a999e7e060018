"""The correction lets a biased leg hop as commanded, and vanishes in an ordinary policy file."""

import numpy as np
import pytest

from hopping_leg.controllers.policy import Policy
from hopping_leg.controllers.registry import load_policy
from hopping_leg.rl.finetune.command_correction import (
    CommandCorrectionConfig,
    LinearCommandCorrection,
)
from hopping_leg.rl.onnx_export import build_policy, read_network
from hopping_leg.sim.channel import Measurement


@pytest.mark.parametrize("name", ["fast", "paper", "precise"])
def test_a_corrected_policy_acts_as_the_policy_does_at_the_corrected_command(name):
    policy = load_policy(name)
    correction = LinearCommandCorrection(0.25, 0.35, (-0.02, 0.01))
    network = correction.applied(read_network(policy.content), policy.card)
    content = build_policy(network, policy.card)
    corrected = Policy(content, "corrected", "corrected")
    rng = np.random.default_rng(1)
    q, qd = rng.normal([0.6, -1.3], 0.3, (5, 3, 2)), rng.normal(0, 2, (5, 3, 2))
    command = np.repeat([[0.28], [0.29], [0.3], [0.32], [0.34]], 3, axis=1)
    age = np.tile([0.0, 0.005, 0.01], (5, 1))
    for controller in (policy, corrected):
        controller.reset(5)
    given = corrected.act(Measurement(q, qd, command, age))
    wanted = policy.act(Measurement(q, qd, correction.corrected(command), age))
    np.testing.assert_allclose(given, wanted, atol=1e-4)
    assert np.abs(given - policy.act(Measurement(q, qd, command, age))).max() > 1e-3


def test_integration_ends_where_a_leg_with_offset_and_slope_hops_true():
    correction, options = LinearCommandCorrection(0.25, 0.35), CommandCorrectionConfig()
    command = np.repeat([0.25, 0.30, 0.35], 8)
    for _ in range(12):
        apex = 0.03 + 0.85 * correction.corrected(command) + 0.05
        correction = correction.updated(command, apex - command, options)
    np.testing.assert_allclose(0.08 + 0.85 * correction.corrected(command), command, atol=0.002)


def test_hops_that_fail_do_not_move_the_correction_of_those_that_do_not():
    command = np.repeat([0.25, 0.30, 0.35], 9)
    error = np.full(27, 0.01)
    error[::9] = -0.2
    options = CommandCorrectionConfig(rate=1.0)
    correction = LinearCommandCorrection(0.25, 0.35).updated(command, error, options)
    np.testing.assert_allclose(correction.shift, [-0.01, 0.0], atol=1e-3)


def test_the_correction_never_strays_far_and_stays_without_hops():
    options = CommandCorrectionConfig(farthest=0.03)
    correction = LinearCommandCorrection(0.25, 0.35)
    assert correction.updated(np.empty(0), np.empty(0), options) is correction
    for _ in range(50):
        correction = correction.updated(np.array([0.25, 0.35]), np.array([0.5, -0.2]), options)
    assert np.abs(correction.corrected(np.array([0.25, 0.35])) - [0.25, 0.35]).max() <= 0.03 + 1e-9
