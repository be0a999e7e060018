import numpy as np
import pytest

from hopping_leg import hop_detection
from hopping_leg.hop_detection import count_skipped, find_bounces, find_hops

RATE = 200.0
GRAVITY = 9.81
STAND = 0.2


def hopping(apexes, stance=0.2, sink=0.03):
    """Ballistic flights to the given apexes, joined by half-sine stances."""
    dip, ticks = np.pi / stance, np.arange(round(stance * RATE)) / RATE
    low = sink * np.sin(dip * ticks)
    stood = np.stack([STAND - low, -sink * dip * np.cos(dip * ticks), -0.2 * low])
    parts = []
    for apex in apexes:
        speed = np.sqrt(2 * GRAVITY * (apex - STAND))
        t = np.arange(int(2 * speed / GRAVITY * RATE)) / RATE
        above = speed * t - GRAVITY / 2 * t**2
        parts += [stood, np.stack([STAND + above, speed - GRAVITY * t, above])]
    return tuple(np.concatenate(parts, axis=1))


def test_every_apex_is_found_within_a_tenth_of_a_millimetre():
    apexes = np.random.default_rng(1).uniform(0.22, 0.4, 40)
    hops = find_hops(*hopping(apexes))
    assert len(hops.apex) == len(apexes)
    assert np.abs(hops.apex - apexes).max() < 1e-4


def test_a_maximum_with_the_foot_on_the_ground_is_no_apex_but_a_bounce_unless_it_is_a_ripple():
    height, rate, gap = hopping([0.3] * 6)
    grounded = np.minimum(gap, hop_detection.FLIGHT_CLEARANCE / 2)
    assert len(find_hops(height, rate, grounded).apex) == 0
    assert len(find_bounces(height, grounded)) == 6
    assert len(find_bounces(height, gap)) == 0
    ripples = STAND + 0.004 * np.sin(2 * np.pi * 3 * np.arange(2000) / RATE)
    assert len(find_bounces(ripples, np.zeros_like(ripples))) == 0


def test_several_apexes_of_one_flight_are_one_hop_as_high_as_the_highest():
    height, rate, gap = hopping([0.3] * 20)
    once = find_hops(height, rate, gap)
    rate[once.tick + 3], rate[once.tick + 4] = 0.1, -0.1
    rate[once.tick - 4], rate[once.tick - 3] = -0.1, 0.1
    again = find_hops(height, rate, gap)
    np.testing.assert_array_equal(again.tick, once.tick)
    np.testing.assert_array_equal(again.apex, once.apex)
    measured = hop_detection.measure_hops(height, rate, gap, RATE)
    assert (len(measured.apex), measured.skipped) == (20, 0)


@pytest.mark.parametrize(("first", "missing"), [(8, 0), (8, 1), (8, 2), (8, 3), (10, 10)])
def test_missing_apexes_are_counted_one_by_one_also_at_the_end(first, missing):
    gone = np.delete(np.arange(50, 2000, 100), slice(first, first + missing))
    assert count_skipped(gone, np.empty(0, dtype=int), 0, 2000, RATE) == missing


def test_a_bounce_in_a_long_gap_is_one_skipped_hop():
    height, rate, gap = hopping([0.3] * 6 + [0.25] + [0.3] * 6)
    ticks = find_hops(height, rate, gap).tick
    low = slice(ticks[5] + 45, ticks[7] - 45)
    gap[low] = np.minimum(gap[low], 0.0)
    hopped, bounced = find_hops(height, rate, gap).tick, find_bounces(height, gap)
    assert len(hopped) == 12
    assert len(bounced) == 1
    assert count_skipped(hopped, bounced, 0, len(height), RATE) == 1


def test_a_leg_that_never_hops_skips_at_the_usual_period():
    none = np.empty(0, dtype=int)
    assert count_skipped(none, none, 0, 2000, RATE) == 2000 / RATE / hop_detection.USUAL_PERIOD
