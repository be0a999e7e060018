import numpy as np

from hopping_leg.evaluate.reach import KNOTS, ReachStudy, _interpolate, flight_tops, measure_reach
from hopping_leg.robot import load_robot

ROBOT = load_robot("legv2-paper")


def study(*torques, **options):
    small = {"generations": 4, "population": 8, "seconds": 2.0, "threads": 1}
    return ReachStudy(ROBOT, torques, **(small | options))


def test_the_highest_point_of_each_whole_flight_counts_once():
    height = np.array([0.3, 0.31, 0.4, 0.39, 0.41, 0.31, 0.3, 0.32, 0.3, 0.35, 0.36])
    flying = np.array([0, 1, 1, 1, 1, 1, 0, 1, 0, 1, 1], dtype=bool)
    np.testing.assert_array_equal(flight_tops(height, flying, 2), [0.41])
    np.testing.assert_array_equal(flight_tops(height, flying, 1), [0.41, 0.32])


def test_torques_go_through_their_knots_and_stay_beyond_them():
    share = np.random.default_rng(0).uniform(-1, 1, (1, 2, 2, len(KNOTS)))
    for rising in (0, 1):
        for knot, length in enumerate(KNOTS):
            found = _interpolate(share, np.array([bool(rising)]), np.array([length]))
            np.testing.assert_allclose(found[0], share[0, rising, :, knot])
        beyond = _interpolate(share, np.array([bool(rising)]), np.array([2.0]))
        np.testing.assert_allclose(beyond[0], share[0, rising, :, -1])


def test_a_search_is_repeatable_and_keeps_within_its_torques():
    found, again = (measure_reach(study((3.0, 3.0)))["rows"] for _ in range(2))
    assert found == again
    assert found[0]["rms_hip_torque_nm"] <= 3.0
    assert found[0]["rms_knee_torque_nm"] <= 3.0


def test_more_torque_reaches_no_less():
    rows = measure_reach(study((6.0, 6.0), (6.0, 12.0), seconds=3.0))["rows"]
    assert 0.3 < rows[0]["apex_m"] <= rows[1]["apex_m"]


def test_without_torque_there_is_no_hop_and_progress_is_told():
    told = []
    rows = measure_reach(study((1e-3, 1e-3), (1e-3, 1e-3)), lambda n, all_: told.append((n, all_)))
    assert [row["apex_m"] for row in rows["rows"]] == [0.0, 0.0]
    assert told == [(n, 8) for n in range(1, 9)]
