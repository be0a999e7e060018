import numpy as np
import pytest

from hopping_leg.viewer.panels import LONGEST, PlaybackClock

TICK = 0.005


@pytest.mark.parametrize("speed", [0.02, 1.0, 2.0])
def test_shown_time_keeps_to_the_speed_over_many_pictures_in_whole_ticks(speed):
    clock = PlaybackClock(TICK)
    clock.speed = speed
    ticks = [clock.due(1 / 60) / TICK for _ in range(600)]
    assert ticks == pytest.approx(np.round(ticks))
    assert sum(ticks) * TICK == pytest.approx(10 * speed, abs=TICK)


def test_nothing_passes_while_paused_but_single_steps_and_no_debt_is_left():
    clock = PlaybackClock(TICK)
    clock.due(0.0149)
    clock.step()
    assert sum(clock.due(1 / 60) for _ in range(60)) == TICK
    assert clock.paused
    clock.paused = False
    assert clock.due(0.004) == 0.0
    assert clock.due(30.0) == pytest.approx(LONGEST), "a stall is not made up for"
    assert clock.due(0.0) == 0.0
