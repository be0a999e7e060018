import pytest
from hypothesis import given
from hypothesis import strategies as st

from hopping_leg.deploy.replies import SLACK, DriveClock

PERIOD = 0.005


def counter(time):
    return int(time * 1000)


@given(
    st.integers(0, 2**33),
    st.lists(st.floats(0.0002, 0.0034), min_size=30, max_size=60),
    st.floats(-1e-4, 1e-4),
)
def test_replies_in_time_are_fresh_and_dated_within_a_millisecond_or_so(boot, delays, drift):
    clock = DriveClock()
    for tick, delay in enumerate(delays):
        asked = 1000.0 + tick * PERIOD
        measured = asked + delay / 2
        shown = (boot + counter(measured * (1 + drift))) % 2**32
        taken = clock.date(shown, asked + delay)
        assert taken is not None
        assert taken >= asked - SLACK
        assert -0.0015 < taken - measured < 0.0035


@given(st.integers(1, 30), st.floats(0.0, 0.003))
def test_a_reply_to_an_earlier_question_is_never_fresh(late, into_the_tick):
    clock = DriveClock()
    for tick in range(40):
        clock.date(counter(1000.0 + tick * PERIOD), 1000.0 + tick * PERIOD + 0.0005)
    asked = 1000.0 + (40 + late) * PERIOD
    taken = clock.date(counter(1000.0 + 40 * PERIOD), asked + into_the_tick)
    assert taken < asked - SLACK
    assert taken == pytest.approx(1000.0 + 40 * PERIOD, abs=0.002)


def test_the_same_reply_again_is_nothing_but_a_drive_that_restarted_is_heard():
    clock = DriveClock()
    assert clock.date(500_000, 10.0) == 10.0
    assert clock.date(500_000, 10.001) is None
    assert clock.date(3, 10.005) == 10.005


def test_a_counter_that_wraps_goes_on():
    clock = DriveClock()
    clock.date(2**32 - 2, 10.0)
    assert clock.date(3, 10.005) == pytest.approx(10.005)
    assert clock.date(2**32 - 1, 10.006) == pytest.approx(10.001)
