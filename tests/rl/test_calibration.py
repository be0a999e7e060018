"""A policy's command is corrected by what its hops miss."""

import dataclasses

import numpy as np
import pytest

from hopping_leg.rl import policy_evaluation
from hopping_leg.rl.policy_evaluation import CALIBRATION_SEEDS, CommandResult, calibrate
from hopping_leg.sim.channel import Measurement
from tests.rl.learners import ROBOT
from tests.rl.test_onnx_export import shown

HEIGHTS = np.linspace(0.20, 0.40, 21)
USUAL = CommandResult(0.3, 0.0, 0.002, 20, 2.0, 0.5, 0, 0, 0.1)


def told(policy, commands):
    """Return what a policy that shows its command is told, m."""
    count = len(commands)
    nothing = np.zeros((count, 3, 2))
    policy.reset(count)
    asked = np.tile(np.asarray(commands)[:, None], (1, 3))
    return policy.act(Measurement(nothing, nothing, asked, np.zeros((count, 3))))[:, 0]


def calibrated(monkeypatch, hop, rounds=3):
    """Return by what the command map of a policy shifts; its hops are ``hop(told, seed)``."""
    seeds = []

    def evaluate_policy(policy, robot, commands, asked, rate):
        seeds.extend(asked)
        reached = hop(told(policy, commands), asked[0])
        return [
            dataclasses.replace(USUAL, command_m=c, median_error_m=float(r - c))
            for c, r in zip(commands, reached, strict=True)
        ]

    monkeypatch.setattr(policy_evaluation, "evaluate_policy", evaluate_policy)
    content = calibrate(shown("three-samples"), ROBOT, rounds)
    assert seeds == list(CALIBRATION_SEEDS[:rounds])
    return told(policy_evaluation.Policy(content, "here", "test"), HEIGHTS) - HEIGHTS


def test_hops_that_are_off_by_what_depends_on_the_height_meet_their_commands(monkeypatch):
    def hop(aim, _seed):
        return aim + 0.004 - 0.06 * (aim - 0.3)

    shifts = calibrated(monkeypatch, hop)
    aims = HEIGHTS + shifts
    assert np.abs(hop(HEIGHTS, 0) - HEIGHTS).max() > 0.008
    assert np.abs(hop(aims, 0) - HEIGHTS).max() < 3e-4


def test_rounds_take_the_mean_of_what_is_due_to_chance(monkeypatch):
    rng = np.random.default_rng(0)
    scatter = {seed: rng.normal(0, 0.003, len(HEIGHTS)) for seed in CALIBRATION_SEEDS}
    shifts = calibrated(monkeypatch, lambda aim, seed: aim + 0.005 + scatter[seed], rounds=4)
    mean = np.mean([scatter[seed] for seed in CALIBRATION_SEEDS], axis=0)
    np.testing.assert_allclose(shifts, -0.005 - mean, atol=1e-5)


@pytest.mark.parametrize("off", [0.05, -0.05])
def test_no_round_trusts_more_than_a_centimetre_and_all_together_two(monkeypatch, off):
    once, often = (calibrated(monkeypatch, lambda aim, _: aim + off, n) for n in (1, 4))
    np.testing.assert_allclose(once, -np.sign(off) * 0.01, atol=1e-6)
    np.testing.assert_allclose(often, -np.sign(off) * 0.02, atol=1e-6)


def test_heights_without_hops_keep_their_command(monkeypatch):
    def hop(aim, _seed):
        return np.where(aim > 0.355, np.nan, aim + 0.006)

    shifts = calibrated(monkeypatch, hop)
    np.testing.assert_allclose(shifts[HEIGHTS < 0.35], -0.006, atol=1e-6)
    np.testing.assert_allclose(shifts[HEIGHTS > 0.365], 0, atol=1e-6)
