import math

import numpy as np
import pytest

from hopping_leg.viewer.panels import LONGEST, PlaybackClock

TICK = 0.005


def shown(clock, pictures, elapsed=1 / 60):
    return sum(clock.due(elapsed) for _ in range(pictures))


@pytest.mark.parametrize("speed", [0.02, 0.25, 1.0, 2.0])
def test_shown_time_keeps_to_the_speed_over_many_pictures(speed):
    clock = PlaybackClock(TICK)
    clock.set_speed(speed)
    ticks = [clock.due(0.0123) / TICK for _ in range(100)]
    assert ticks == pytest.approx(np.round(ticks))
    clock = PlaybackClock(TICK)
    clock.set_speed(speed)
    assert shown(clock, 600) == pytest.approx(10 * speed, abs=TICK)
    assert clock.real_time == pytest.approx(1.0, abs=0.2)


def test_nothing_passes_while_paused_but_single_steps_and_no_debt_is_left():
    clock = PlaybackClock(TICK)
    clock.due(0.0149)
    clock.paused = True
    assert shown(clock, 60) == 0.0
    clock.step()
    assert shown(clock, 60) == TICK
    assert clock.paused
    assert math.isnan(clock.real_time)
    clock.paused = False
    assert clock.due(0.004) == 0.0


def test_a_stall_is_not_made_up_for_and_falling_behind_is_told():
    clock = PlaybackClock(TICK)
    assert clock.due(30.0) == pytest.approx(LONGEST)
    assert clock.due(0.0) == 0.0
    clock.set_speed(1.0)
    assert shown(clock, 20, 0.2) == pytest.approx(20 * LONGEST)
    assert clock.real_time == pytest.approx(0.5)
