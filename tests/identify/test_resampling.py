import numpy as np
import pytest

from hopping_leg.identify.resampling import HeldSignal, RowResampling

TICK = 0.004
LONG, SHORT = np.array([0.0, 0.0053, 0.01, 0.0149]), np.array([0.0, 0.004])


def at_ticks(function):
    """Return a function of time at the ticks of one hypothesis's two windows, both joints."""
    values = function(TICK * np.arange(PLACES.ticks))
    return np.broadcast_to(values[:, None, None, None], (PLACES.ticks, 1, 2, 2))


PLACES = RowResampling([LONG, SHORT], TICK)


def test_a_cubic_motion_is_met_at_every_row():
    q = at_ticks(lambda t: 1 - 3 * t + 40 * t**2 - 900 * t**3)
    qd = at_ticks(lambda t: -3 + 80 * t - 2700 * t**2)
    position, velocity = PLACES.cubic(q, qd)
    expected = 1 - 3 * LONG + 40 * LONG**2 - 900 * LONG**3
    np.testing.assert_allclose(position[0, 0, :, 0], expected, atol=1e-12)
    np.testing.assert_allclose(velocity[0, 0, :, 1], -3 + 80 * LONG - 2700 * LONG**2, atol=1e-10)


def test_a_straight_line_is_met_at_every_row():
    got = PLACES.linear(at_ticks(lambda t: 2 - 5 * t))
    np.testing.assert_allclose(got[0, 0, :, 0], 2 - 5 * LONG, atol=1e-12)


def test_a_shorter_window_is_padded_with_its_last_row():
    np.testing.assert_array_equal(PLACES.padding, [[False] * 4, [False, False, True, True]])
    got = PLACES.linear(at_ticks(lambda t: t))[0, 1, :, 0]
    assert got == pytest.approx([0.0, 0.004, 0.004, 0.004])


TIME = np.array([0.0, 0.1, 0.25, 0.3])
VALUES = np.array([[1.0], [2.0], [-1.0], [4.0]])
SLOPES = np.array([[10.0], [0.0], [2.0], [5.0]])


def numeric(time):
    row = np.clip(np.searchsorted(TIME, time, side="right") - 1, 0, 3)
    slope = np.where((time < 0) | (row == 3), 0.0, SLOPES[row, 0])
    return VALUES[row, 0] + slope * (time - TIME[row])


def test_averages_equal_fine_sums():
    held = HeldSignal(TIME, VALUES, SLOPES)
    for start in (-0.05, 0.03, 0.08, 0.22, 0.29, 0.4):
        fine = start + (np.arange(20000) + 0.5) / 20000 * 0.07
        got = held.average(np.array(start), 0.07)[0]
        np.testing.assert_allclose(got, numeric(fine).mean(), atol=1e-3)


def test_values_hold_until_the_next_row():
    at = HeldSignal(TIME, VALUES).at(np.array([-1.0, 0.0999, 0.1, 0.27, 9.0]))[:, 0]
    np.testing.assert_array_equal(at, [1.0, 1.0, 2.0, -1.0, 4.0])
