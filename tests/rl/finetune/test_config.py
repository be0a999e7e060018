"""When a policy is rolled back, and when its training ends."""

from hopping_leg.rl.finetune.config import StoppingRules

RULES = StoppingRules(minutes=2.0, tolerance=0.004, margin=0.01, patience=3, gain=0.001, confirm=2)


def test_it_stops_once_two_checks_are_good_enough():
    assert not RULES.reason([0.02, 0.003], 0.5, 0.25)
    assert "within 4 mm" in RULES.reason([0.02, 0.003, 0.004], 0.5, 0.25)


def test_it_stops_before_the_minutes_are_exceeded():
    assert not RULES.reason([0.02], 1.75, 0.25)
    assert "used up" in RULES.reason([0.02], 1.76, 0.25)


def test_it_stops_when_nothing_improves():
    assert not RULES.reason([0.02, 0.021, 0.022, 0.015], 1.0, 0.25)
    assert "improved" in RULES.reason([0.02, 0.021, 0.0195, 0.023], 1.0, 0.25)


def test_only_a_confirmed_decline_is_rolled_back():
    assert not RULES.rolled_back([0.01, 0.03])
    assert not RULES.rolled_back([0.01, 0.03, 0.015])
    assert RULES.rolled_back([0.01, 0.03, 0.025])
