import math

import pytest

from hopping_leg.viewer.pace import LONGEST, Pace

TICK = 0.005


def shown(pace, pictures, elapsed=1 / 60):
    return sum(pace.due(elapsed) for _ in range(pictures))


@pytest.mark.parametrize("speed", [0.02, 0.25, 1.0, 2.0])
def test_shown_time_keeps_to_the_speed_over_many_pictures(speed):
    pace = Pace(TICK)
    pace.set_speed(speed)
    assert shown(pace, 600) == pytest.approx(10 * speed, abs=TICK)
    assert pace.real_time == pytest.approx(1.0, abs=0.2)


def test_every_share_is_a_whole_number_of_ticks():
    pace = Pace(TICK)
    for _ in range(100):
        ticks = pace.due(0.0123) / TICK
        assert ticks == pytest.approx(round(ticks))


def test_nothing_passes_while_paused_but_single_steps():
    pace = Pace(TICK)
    pace.paused = True
    assert shown(pace, 60) == 0.0
    pace.step()
    assert shown(pace, 60) == TICK
    assert pace.paused
    assert math.isnan(pace.real_time)


def test_a_stall_is_not_made_up_for():
    pace = Pace(TICK)
    assert pace.due(30.0) == pytest.approx(LONGEST)
    assert pace.due(0.0) == 0.0


def test_a_pause_leaves_no_debt():
    pace = Pace(TICK)
    pace.due(0.0149)
    pace.paused = True
    pace.due(1.0)
    pace.paused = False
    assert pace.due(0.004) == 0.0


def test_falling_behind_is_told():
    pace = Pace(TICK)
    for _ in range(20):
        pace.due(0.2)
    assert pace.real_time == pytest.approx(0.5)
