import numpy as np

from hopping_leg.identify.held_signal import HeldSignal

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
