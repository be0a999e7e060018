"""A reward follows from its list of terms: names, sum, annealing, what is remembered."""

import numpy as np
import pytest

from hopping_leg.envs import HoppingEnv, HoppingTask, Reward, RewardTerm, TaskConfig, paper_reward
from hopping_leg.errors import UsageError
from hopping_leg.robot import load_robot

ROBOT = load_robot("legv2-paper")


def squared_action(transition):
    return np.sum(np.square(transition.action), axis=1)


class Patience:
    """Counts the ticks of an episode."""

    def __init__(self):
        self.ticks = np.zeros(3)

    def __call__(self, transition):
        self.ticks = self.ticks + 1
        return self.ticks

    def reset(self, rows):
        self.ticks[rows] = 0

    def state(self):
        return {"ticks": self.ticks.copy()}

    def restore(self, state):
        self.ticks = state["ticks"].copy()


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
    env.reset(seed=0)
    assert tuple(env.step(np.zeros(2, np.float32))[4]["reward_terms"]) == more.reward.names


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
        reward.anneal(share)
        step = task.step(np.zeros((2, 2)))
        assert (step.reward == expected).all()
        assert (step.terms == 1.0).all()


def test_two_terms_of_one_name_are_refused():
    with pytest.raises(UsageError, match="names of their own"):
        paper_reward(ROBOT).with_terms(RewardTerm("jerk", 1.0, squared_action))
