"""When a policy is rolled back, and when its training ends."""

import pytest

from hopping_leg.rl.finetune.config import StoppingRules

RULES = StoppingRules(minutes=2.0, tolerance=0.004, margin=0.01, patience=3, gain=0.001, confirm=2)


@pytest.mark.parametrize(
    ("going_on", "ended", "says"),
    [
        (([0.02, 0.003], 0.5), ([0.02, 0.003, 0.004], 0.5), "within 4 mm"),
        (([0.02], 1.75), ([0.02], 1.76), "used up"),
        (([0.02, 0.021, 0.022, 0.015], 1.0), ([0.02, 0.021, 0.0195, 0.023], 1.0), "improved"),
    ],
)
def test_it_stops_when_good_enough_without_time_or_without_gain(going_on, ended, says):
    assert not RULES.reason(*going_on, 0.25)
    assert says in RULES.reason(*ended, 0.25)


def test_only_a_confirmed_decline_is_rolled_back():
    rolled = [RULES.rolled_back([0.01, 0.03, *more]) for more in ([], [0.015], [0.025])]
    assert rolled == [False, False, True]
