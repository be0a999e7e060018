import numpy as np
import pytest

from hopping_leg.viewer.panels import LONGEST, PlaybackClock

TICK = 0.005


def shown(clock, pictures, elapsed=1 / 60):
    return sum(clock.due(elapsed) for _ in range(pictures))


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
    clock.paused = True
    assert shown(clock, 60) == 0.0
    clock.step()
    assert shown(clock, 60) == TICK
    assert clock.paused
    clock.paused = False
    assert clock.due(0.004) == 0.0


def test_a_stall_is_not_made_up_for():
    clock = PlaybackClock(TICK)
    assert clock.due(30.0) == pytest.approx(LONGEST)
    assert clock.due(0.0) == 0.0
