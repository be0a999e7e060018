"""The apex reward pays for reached heights, not for standing at them."""

import numpy as np
import pytest

from hopping_leg.envs import ApexRewardConfig, apex_reward
from hopping_leg.envs.apex_reward import GRAVITY, TOUCH
from hopping_leg.robot import load_robot
from tests.envs.transitions import transition

CONFIG = ApexRewardConfig()


def make(config=CONFIG):
    return apex_reward(load_robot("legv2-paper"), config, 200.0)


def term(reward, name, *args, **state):
    _, terms = reward(transition(*args, **state))
    return terms[0, reward.names.index(name)]


@pytest.fixture
def reward():
    return make()


def fly(reward, ticks):
    for _ in range(ticks):
        reward(transition(0.28, 0.5))


def test_a_true_hop_earns_the_event_and_a_tremble_does_not(reward):
    fly(reward, 100)
    hop = term(reward, "apex", 0.3, 0.0, apex=True)
    reward(transition(0.3, 0.0, clearance=-0.001))
    tremble = term(reward, "apex", 0.3, 0.0, apex=True)
    assert hop == pytest.approx(1.0)
    assert tremble < 0.01


def test_hasty_hops_earn_no_more_per_second():
    earned = {}
    for period in (40, 80):
        fresh = make()
        earned[period] = sum(
            term(fresh, "apex", 0.3, 0.0, apex=tick % period == 0) for tick in range(1, 1601)
        )
    assert earned[40] == pytest.approx(earned[80], rel=0.05)


def test_error_costs_alike_above_and_below_and_more_as_training_goes_on(reward):
    values = []
    for share, error in ((0.0, -0.02), (0.0, 0.02), (1.0, 0.02)):
        reward.anneal(share)
        fly(reward, 100)
        values.append(term(reward, "apex", 0.3 + error, 0.0, apex=True))
    assert values[0] == pytest.approx(values[1])
    assert values[2] < values[1]


def test_prediction_is_the_ballistic_apex(reward):
    rate = np.sqrt(2 * GRAVITY * 0.1)
    assert term(reward, "predicted", 0.2, rate) > term(reward, "predicted", 0.15, rate)
    assert term(reward, "predicted", 0.2, rate, clearance=0.0) == 0.0


def test_power_costs_as_much_braking_as_driving_and_only_later_in_training():
    reward = make(ApexRewardConfig(power=0.5))
    driving, braking = (
        term(reward, "power", torque=(4.0, torque), qd=(-1.0, 5.0)) for torque in (6.0, -6.0)
    )
    robot = load_robot("legv2-paper")
    length = robot.thigh.length + robot.shank.length
    assert driving == braking == pytest.approx(34 / (robot.mass * 9.81 * np.sqrt(9.81 * length)))
    busy, idle = transition(torque=(4.0, 6.0), qd=(1.0, 5.0)), transition(qd=(1.0, 5.0))
    for share, price in ((0.0, 0.0), (0.25, 0.25), (1.0, 0.5)):
        reward.anneal(share)
        cost = reward(idle)[0] - reward(busy)[0]
        assert cost == pytest.approx(CONFIG.scale * price * driving)


def test_energy_gain_fades_and_can_end_where_the_hop_would_be_too_high(reward):
    moving, still = transition(0.2, 1.0, clearance=0.0), transition(0.2, 0.0, clearance=0.0)
    (early,), (rest,) = reward(moving)[0], reward(still)[0]
    assert early - rest == pytest.approx(CONFIG.scale * CONFIG.energy)
    reward.anneal(0.5)
    assert reward(moving)[0] == reward(still)[0] == pytest.approx(rest)
    bounded, free = make(ApexRewardConfig(energy_beyond=0.03)), make()
    low, high = (
        [term(r, "energy", 0.25, 1.5, command=command) for r in (bounded, free)]
        for command in (0.22, 0.40)
    )
    assert low[0] < 0.05 * low[1]
    assert high[0] == high[1] == low[1]


def test_joints_pay_near_their_limits_and_more_once_the_leg_hops():
    reward, robot = make(ApexRewardConfig(limits=(1.0, 10.0))), load_robot("legv2-paper")
    for limit, inwards in ((robot.of_joints("lower"), 1), (robot.of_joints("upper"), -1)):
        assert term(reward, "limits", q=limit + inwards * 0.051) == 0.0
        assert term(reward, "limits", q=limit - inwards * 0.01) == pytest.approx(0.12)
    inside, outside = transition(), transition(q=robot.of_joints("upper"))
    paid = []
    for share in (0.0, 0.25, 0.5, 1.0):
        reward.anneal(share)
        paid.append((reward(inside)[0] - reward(outside)[0])[0] / 0.1 / CONFIG.scale)
    np.testing.assert_allclose(paid, [1.0, 5.5, 10.0, 10.0])


def test_reversals_of_torque_are_counted():
    reward = make(ApexRewardConfig(reversals=1.0))
    turns = {((0.15, 0.5), (-0.15, -0.5)): 2, ((0.05, 0), (-0.05, 0.5)): 0, ((0.9, 0), (0.1, 0)): 0}
    for (action, last), count in turns.items():
        assert term(reward, "reversals", action=action, last=last) == count


def test_coming_close_to_the_ground_costs(reward):
    assert term(reward, "clearance", 0.2, 0.0) == 0.0
    near, touching = (term(reward, "clearance", height, 0.0) for height in (0.15, 0.13))
    assert 0.0 < near < 1.0 < TOUCH < touching
