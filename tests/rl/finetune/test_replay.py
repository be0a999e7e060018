"""Transitions from an undisturbed trace are those that the environment would have given."""

import numpy as np
import pytest

from hopping_leg.controllers import RolloutConfig, rollout
from hopping_leg.envs import HoppingTask, TaskConfig, apex_reward
from hopping_leg.hop_detection import find_hops
from hopping_leg.rl.finetune.config import FinetuneConfig
from hopping_leg.rl.finetune.replay import CRITIC_SIZE, TransitionWriter
from hopping_leg.rl.finetune.simulated import Witness, traces_of
from hopping_leg.rl.finetune.trial_data import ApexEstimate, TrialData
from hopping_leg.rl.onnx_export import read_network
from hopping_leg.sim import NO_NOISE

from .trials import POLICY, ROBOT

TICKS = 300
COMMAND = 0.3


@pytest.fixture(scope="module")
def run():
    witness = Witness(POLICY, None)
    commands = np.full((TICKS, 1), COMMAND)
    setup = RolloutConfig(ROBOT, NO_NOISE, threads=1)
    return rollout(witness, setup, commands, 3, on_legs=witness.watch)


def writer():
    reward = apex_reward(ROBOT, FinetuneConfig().reward, 200.0)
    reward.anneal(1.0)
    return TransitionWriter(POLICY.card, read_network(POLICY.content), ROBOT, reward, 5.0), reward


def truth(run):
    """Return a perfect estimate."""
    height, rate, gap = (
        run.data[name] for name in ("height_m", "height_rate_m_s", "foot_clearance_m")
    )
    hops = find_hops(height[:, 0], rate[:, 0], gap[:, 0])
    apexes = np.stack([hops.tick.astype(float), hops.apex], axis=1)
    return ApexEstimate(height, rate, gap >= 0.003, [apexes])


def environment(run):
    """Return observations and rewards of the environment on the same actions."""
    card, network = POLICY.card, read_network(POLICY.content)
    middle, half = network.offset[-1], 1 / network.gain[-1]
    options = TaskConfig(
        observation=card.layout, action_torque=card.torque_scale, commands=(COMMAND,),
        command_range=(middle - half, middle + half), disturbance=NO_NOISE, episode=60.0,
    )  # fmt: skip
    _, reward = writer()
    task = HoppingTask(ROBOT, 1, options, reward, np.random.default_rng(0), 1, autoreset=False)
    task.command[:] = COMMAND
    task.legs.stand(slice(None), RolloutConfig(ROBOT).start_posture)
    q, qd = task.legs.q.copy(), task.legs.qd.copy()
    task.plant.channel.restart(slice(None), q, qd, task.command)
    task.observation.restart(np.arange(1), task.plant.samples(task.command), task.plant.channel)
    seen = [task.observation.view(task.plant.samples(task.command))]
    rewards = []
    asked = np.stack([run.data["hip_command_nm"], run.data["knee_command_nm"]], axis=-1)
    for tick in range(TICKS - 1):
        step = task.step(asked[tick] / np.array(card.torque_scale))
        seen.append(step.observation)
        rewards.append(step.reward[0])
    return np.concatenate(seen), np.array(rewards)


def test_observations_and_rewards_are_the_environments(run):
    write, _ = writer()
    rows = write(TrialData.of(traces_of(run)), truth(run))
    seen, rewards = environment(run)
    own = rows.observation[:, :-CRITIC_SIZE]
    np.testing.assert_allclose(own, seen[:-1], atol=2e-3)
    np.testing.assert_allclose(rows.following[:-1], rows.observation[1:])
    assert rewards.max() > 0.5
    # Where the foot has just left the ground, true and believed flight may differ for a tick.
    assert np.mean(np.abs(rows.reward - rewards) < 2e-3) > 0.98
    assert not rows.done.any()


def test_a_trial_that_was_ended_costs_and_is_terminal(run):
    write, _ = writer()
    data, estimate = TrialData.of(traces_of(run)), truth(run)
    fine, ended = write(data, estimate), write(data, estimate, ended=True)
    assert ended.done[-1] == 1
    assert not ended.done[:-1].any()
    np.testing.assert_allclose(fine.reward[-1] - ended.reward[-1], 5.0, rtol=1e-5)
