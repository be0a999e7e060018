"""A reward follows from its list of terms: names, sum, annealing, what is remembered."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hopping_leg.envs import (
    HoppingEnv,
    HoppingTask,
    LastingTerm,
    PaperRewardConfig,
    Reward,
    RewardTerm,
    TaskConfig,
    paper_reward,
)
from hopping_leg.errors import UsageError
from hopping_leg.robot import load_robot
from tests.envs.transitions import transition

ROBOT = load_robot("legv2-paper")


def squared_action(transition):
    return np.sum(np.square(transition.action), axis=1)


class Patience(LastingTerm):
    """Counts the ticks of an episode."""

    STATE = ("ticks",)

    def __init__(self):
        self.ticks = np.zeros(3)

    def __call__(self, transition):
        self.ticks = self.ticks + 1
        return self.ticks

    def restart(self, rows):
        self.ticks[rows] = 0


def make_task(*terms, episode=0.05, seed=0):
    reward = paper_reward(ROBOT).with_terms(*terms)
    rng = np.random.default_rng(seed)
    return HoppingTask(ROBOT, 3, TaskConfig(episode=episode), reward, rng, 1)


def test_a_term_is_a_function_and_a_line():
    plain, more = make_task(), make_task(RewardTerm("torque", -0.5, squared_action))
    assert more.reward.names == (*plain.reward.names, "torque")
    action = np.random.default_rng(1).uniform(-1, 1, (3, 2))
    without, step = plain.step(action), more.step(action)
    np.testing.assert_array_equal(step.terms[:, :-1], without.terms)
    np.testing.assert_allclose(step.terms[:, -1], np.sum(action**2, axis=1))
    np.testing.assert_allclose(step.reward, without.reward - 0.5 * step.terms[:, -1])
    env = HoppingEnv(reward=more.reward)
    _, info = env.reset(seed=0)
    assert info["base_height"] == pytest.approx(0.2 + ROBOT.foot.radius)
    _, reward, *_, info = env.step(np.zeros(2, np.float32))
    weighted = [term.weight * info[f"reward_{term.name}"] for term in more.reward.terms]
    assert reward == pytest.approx(sum(weighted))


def test_a_term_may_remember_and_goes_on_exactly():
    patience = RewardTerm("patience", 1.0, Patience())
    task = make_task(patience)
    seen = [task.step(np.zeros((3, 2))).terms[0, -1] for _ in range(15)]
    assert seen == [*range(1, 11), *range(1, 6)]
    other = make_task(RewardTerm("patience", 1.0, Patience()), seed=7)
    other.restore(task.state())
    assert (other.step(np.zeros((3, 2))).terms[:, -1] == 6).all()


def test_a_weight_may_depend_on_the_share_of_the_training():
    one = RewardTerm("one", lambda share: 4.0 * (1 - share), lambda transition: 1.0)
    reward = Reward([one], scale=0.5)
    task = HoppingTask(ROBOT, 2, TaskConfig(), reward, np.random.default_rng(0), 1)
    for share, expected in ((0.0, 2.0), (0.25, 1.5), (1.0, 0.0)):
        task.reward.anneal(share)
        step = task.step(np.zeros((2, 2)))
        assert (step.reward == expected).all()
        assert (step.terms == 1.0).all()


def test_two_terms_of_one_name_are_refused():
    with pytest.raises(UsageError, match="names of their own"):
        paper_reward(ROBOT).with_terms(RewardTerm("jerk", 1.0, squared_action))


LOWER, UPPER = ROBOT.of_joints("lower"), ROBOT.of_joints("upper")
SPEED = ROBOT.of_joints("no_load_speed")
REST = 0.2 + ROBOT.foot.radius
PRINTED = PaperRewardConfig()


def terms_of(config=PRINTED, **state):
    paper = paper_reward(ROBOT, config)
    reward, terms = paper(transition(**state))
    return float(reward[0]), dict(zip(paper.names, terms[0].tolist(), strict=True))


heights, rates = st.floats(0.05, 0.6), st.floats(-5, 5)
angles = st.tuples(st.floats(-2, 3), st.floats(-4, 1))
speeds = st.tuples(st.floats(-90, 90), st.floats(-90, 90))
actions = st.tuples(st.floats(-1, 1), st.floats(-1, 1))


@given(heights, rates, angles, speeds, st.floats(0.2, 0.4), actions, actions)
def test_every_term_is_as_printed(height, rate, q, qd, command, action, last):
    reward, terms = terms_of(
        height=height, rate=rate, q=q, qd=qd, command=command, action=action, last=last
    )
    energy = rate**2 + (height - REST) ** 2
    barrier = math.exp(height - command) if height >= command else 0.0
    jerk = sum((a - b) ** 2 for a, b in zip(action, last, strict=True))
    position = sum(
        min(math.exp(-10 * (x - low)) + math.exp(10 * (x - high)), 1.0)
        for x, low, high in zip(q, LOWER, UPPER, strict=True)
    )
    velocity = sum(v**2 - m**2 if abs(v) > m else 0.0 for v, m in zip(qd, SPEED, strict=True))
    expected = {"energy": energy, "height": barrier, "jerk": jerk, "position": position}
    expected["velocity"] = velocity
    assert terms == pytest.approx(expected, rel=1e-9, abs=1e-9)
    total = 0.5 * energy - 2 * barrier - 0.05 * jerk - 0.02 * position - 0.005 * velocity
    assert reward == pytest.approx(total, rel=1e-9, abs=1e-9)


def test_the_height_barrier_as_printed_rewards_overshoot():
    config = PaperRewardConfig(barrier="printed")
    assert terms_of(config, height=0.35)[1]["height"] == pytest.approx(1 - math.exp(0.05))
    below, above = (terms_of(config, height=height) for height in (0.29, 0.40))
    assert below[1]["height"] == 0.0
    assert above[0] > below[0]
