"""The apex reward pays for reached heights, not for standing at them."""

import numpy as np
import pytest

from hopping_leg.envs.apex_reward import ApexReward, ApexRewardOptions
from hopping_leg.envs.transition import Transition
from hopping_leg.robot import load_robot

RATE = 200.0


NAMES = ApexReward.names


def transition(height, rate, *, command=0.3, clearance=0.05, apex=False):
    return Transition(
        state=np.array([[height, 0.7, -1.4, rate, 0.0, 0.0]]),
        command=np.array([command]),
        action=np.zeros((1, 2)),
        last_action=np.zeros((1, 2)),
        apex=np.array([apex]),
        apex_height=np.array([height]),
        measure_clearance=lambda: np.array([clearance]),
    )


@pytest.fixture
def reward():
    return ApexReward(load_robot("legv2-paper"), ApexRewardOptions(), RATE)


def fly(reward, ticks):
    for _ in range(ticks):
        reward(transition(0.28, 0.5))


def test_a_true_hop_earns_the_event_and_a_tremble_does_not(reward):
    fly(reward, 100)
    _, hop = reward(transition(0.3, 0.0, apex=True))
    reward(transition(0.3, 0.0, clearance=-0.001))
    _, tremble = reward(transition(0.3, 0.0, apex=True))
    assert hop[0, NAMES.index("apex")] == pytest.approx(reward.options.apex)
    assert tremble[0, NAMES.index("apex")] < 0.01 * hop[0, NAMES.index("apex")]


def test_hasty_hops_earn_no_more_per_second(reward):
    earned = {}
    for period in (40, 80):
        fresh = ApexReward(load_robot("legv2-paper"), ApexRewardOptions(), RATE)
        total = 0.0
        for tick in range(1, 1601):
            _, terms = fresh(transition(0.3, 0.0, apex=tick % period == 0))
            total += terms[0, NAMES.index("apex")]
        earned[period] = total
    assert earned[40] == pytest.approx(earned[80], rel=0.05)


def test_error_costs_alike_above_and_below_and_more_as_training_goes_on(reward):
    values = {}
    for share in (0.0, 1.0):
        reward.anneal(share)
        for error in (-0.02, 0.02):
            fly(reward, 100)
            _, terms = reward(transition(0.3 + error, 0.0, apex=True))
            values[share, error] = terms[0, NAMES.index("apex")]
    assert values[0.0, -0.02] == pytest.approx(values[0.0, 0.02])
    assert values[1.0, 0.02] < values[0.0, 0.02]


def test_prediction_is_the_ballistic_apex(reward):
    rise = 0.1
    rate = np.sqrt(2 * reward.options.effective_gravity * rise)
    _, right = reward(transition(0.2, rate))
    _, wrong = reward(transition(0.15, rate))
    assert right[0, NAMES.index("predicted")] > wrong[0, NAMES.index("predicted")]
    _, standing = reward(transition(0.2, rate, clearance=0.0))
    assert standing[0, NAMES.index("predicted")] == 0.0


def test_energy_gain_fades(reward):
    _, early = reward(transition(0.2, 1.0, clearance=0.0))
    reward.anneal(0.5)
    _, late = reward(transition(0.2, 1.0, clearance=0.0))
    assert early[0, NAMES.index("energy")] > 0.0
    assert late[0, NAMES.index("energy")] == 0.0


def test_the_energy_gain_can_end_where_the_hop_would_be_too_high():
    options = ApexRewardOptions(energy_beyond=0.03)
    bounded, free = (
        ApexReward(load_robot("legv2-paper"), o, RATE) for o in (options, ApexRewardOptions())
    )

    def gains(command):
        moving = transition(0.25, 1.5, command=command)
        return [r(moving)[1][0, NAMES.index("energy")] for r in (bounded, free)]

    low, high = gains(0.22), gains(0.40)
    assert low[0] < 0.05 * low[1]
    assert high[0] == high[1] == low[1]


def test_coming_close_to_the_ground_costs(reward):
    _, high = reward(transition(0.2, 0.0))
    _, low = reward(transition(0.06, 0.0))
    assert high[0, NAMES.index("clearance")] == 0.0
    assert low[0, NAMES.index("clearance")] < 0.0


def test_state_survives_a_restart(reward):
    fly(reward, 10)
    other = ApexReward(load_robot("legv2-paper"), ApexRewardOptions(), RATE)
    other.restore(reward.state())
    total, _ = reward(transition(0.3, 0.0, apex=True))
    again, _ = other(transition(0.3, 0.0, apex=True))
    assert total == again
