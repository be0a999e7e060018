"""SAC begins as the policy, learns, and is restored exactly."""

import dataclasses

import numpy as np
import pytest
import torch

from hopping_leg.controllers.policy import Policy
from hopping_leg.controllers.registry import load_policy
from hopping_leg.rl.finetune.command_correction import (
    CommandCorrectionConfig,
    LinearCommandCorrection,
)
from hopping_leg.rl.finetune.learner import Learner, SacConfig
from hopping_leg.rl.finetune.replay import CRITIC_SIZE, EDGE, ExploringPolicy, Transitions
from hopping_leg.rl.onnx_export import build_policy, read_network
from hopping_leg.sim.channel import Measurement
from tests.rl.test_onnx_export import made

POLICIES = {"paper": load_policy("paper"), "clip": Policy(made("dated", (16, 8)), "here", "clip")}
TINY = SacConfig(critic=(8, 8), batch_size=16, actor_share=1.0, change=np.inf)


def rows(size, count=200, reward=None):
    rng = np.random.default_rng(0)
    seen = rng.normal(size=(count, size + CRITIC_SIZE)).astype(np.float32)
    action = rng.uniform(-0.9, 0.9, (count, 2)).astype(np.float32)
    given = np.zeros(count) if reward is None else reward(action)
    done = np.ones(count, np.float32)
    return Transitions(seen, seen, action, given.astype(np.float32), done)


def learner(name, reward=None, options=TINY):
    network = read_network(POLICIES[name].content)
    return Learner(network, rows(len(network.offset), reward=reward), options, 0), network


def act(sac, seen):
    with torch.no_grad():
        return sac.model.actor(seen, deterministic=True)


@pytest.mark.parametrize("name", POLICIES)
def test_the_actor_gives_the_policys_torques(name):
    sac, network = learner(name)
    seen = rows(len(network.offset)).observation
    action = act(sac, torch.from_numpy(seen)).numpy()
    policy = POLICIES[name]
    session = policy._session
    shapes, at, feeds = policy.inputs, 0, {}
    raw = seen[:, : len(network.offset)] / network.gain + network.offset
    for part, shape in shapes.items():
        width = int(np.prod(shape))
        feeds[part] = raw[:, at : at + width].reshape(-1, *shape).astype(np.float32)
        at += width
    torque = session.run(None, feeds)[0] / np.array(policy.card.torque_scale)
    wanted = np.clip(torque, -EDGE, EDGE) if network.squash == "clip" else torque
    np.testing.assert_allclose(action, wanted, atol=2e-4)


def test_an_untrained_learner_exports_the_policy_it_was_given():
    sac, _ = learner("clip")
    policy = POLICIES["clip"]
    assert build_policy(sac.network(), policy.card) == policy.content


@pytest.mark.parametrize("side", [-1, 1])
def test_actions_move_to_where_the_reward_is(side):
    sac, network = learner("clip", lambda action: side * action.sum(axis=1))
    seen = torch.from_numpy(rows(len(network.offset)).observation)
    before = act(sac, seen).mean()
    sac.learn(150, 1)
    assert side * (act(sac, seen).mean() - before) > 0.3


def test_a_round_changes_actions_no_more_than_it_may():
    options = dataclasses.replace(TINY, change=0.02)
    sac, network = learner("clip", lambda action: -np.abs(action - 0.5).sum(axis=1), options)
    real = rows(len(network.offset), 50)
    seen = torch.from_numpy(real.observation)

    for data in (False, True):
        before = act(sac, seen)
        sac.learn(100, 1)
        moved = (act(sac, seen) - before).square().mean().sqrt()
        assert moved > 1e-4
        if data:
            assert moved <= 0.02
        sac.keep(real)


def test_frozen_parts_stay():
    sac, network = learner("clip", lambda action: action.sum(axis=1))
    sac.learn(5, 1, critics_only=True)
    for (now, _), (then, _) in zip(sac.network().layers, network.layers, strict=True):
        np.testing.assert_array_equal(now, then.astype(np.float32))
    last = SacConfig(critic=(8, 8), batch_size=16, last_layer=True)
    sac, network = learner("clip", lambda action: action.sum(axis=1), last)
    sac.learn(5, 1)
    np.testing.assert_array_equal(
        sac.network().layers[0][0], network.layers[0][0].astype(np.float32)
    )
    assert (sac.network().layers[-1][0] != network.layers[-1][0]).any()


def test_learning_goes_on_exactly_from_a_stored_state():
    whole, _ = learner("clip", lambda action: action.sum(axis=1))
    whole.learn(4, 1)
    state = whole.state()
    whole.learn(4, 2)
    again, _ = learner("clip", lambda action: action.sum(axis=1))
    again.restore(state)
    again.learn(4, 2)
    for (one, _), (other, _) in zip(whole.network().layers, again.network().layers, strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_batch_mixes_both_robots_once_the_real_one_is_known():
    sac, network = learner("clip")
    real = rows(len(network.offset), 50)
    buffer = sac.model.replay_buffer
    assert len(buffer.sample(16).rewards) == 16
    sac.keep(Transitions(real.observation, real.following, real.action, real.reward + 1, real.done))
    share = buffer.sample(400).rewards.numpy().mean()
    np.testing.assert_allclose(share, 1 - TINY.believed_share)


def test_exploration_without_spread_is_the_policy_and_with_it_stays_within_torque_limits():
    policy = POLICIES["clip"]
    hidden = len(read_network(policy.content).layers[-1][0][0])
    rng = np.random.default_rng(2)
    q, qd = rng.normal([0.6, -1.3], 0.3, (4, 3, 2)), rng.normal(0, 2, (4, 3, 2))
    seen = Measurement(q, qd, np.full((4, 3), 0.3), np.tile([0.0, 0.005, 0.01], (4, 1)))
    policy.reset(4)
    most = np.array(policy.card.torque_scale)
    wanted = np.clip(policy.act(seen), -most * EDGE, most * EDGE)
    for spread, same in ((0.0, True), (3.0, False)):
        matrix = np.full((hidden, 2), spread)
        explorer = ExploringPolicy(policy.content, policy.card, matrix, 4, np.random.default_rng(0))
        explorer.reset(4)
        torque = explorer.act(seen)
        assert np.allclose(torque, wanted, atol=1e-5) == same
        assert (np.abs(torque) <= most).all()


@pytest.mark.parametrize("name", POLICIES)
def test_a_corrected_policy_acts_as_the_policy_does_at_the_corrected_command(name):
    policy = POLICIES[name]
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
