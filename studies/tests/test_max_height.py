import numpy as np

from hopping_leg.evaluate.result_files import ResultCache
from studies.max_height.run import KNOTS, Reach, _interpolate, flight_tops, measure_reach


def study(*torques, **options):
    small = {"generations": 4, "population": 8, "seconds": 2.0, "threads": 1}
    return Reach("legv2-paper", torques, **(small | options))


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


def test_a_search_is_repeatable_and_keeps_within_its_torques(tmp_path):
    caches = [ResultCache(tmp_path / name) for name in "ab"]
    found, again = (measure_reach(study((3.0, 3.0)), cache)["rows"] for cache in caches)
    assert found == again
    assert found[0]["rms_hip_torque_nm"] <= 3.0
    assert found[0]["rms_knee_torque_nm"] <= 3.0


def test_more_torque_reaches_no_less_and_a_killed_search_goes_on(tmp_path):
    pairs, cache, begun = ((6.0, 6.0), (6.0, 12.0)), ResultCache(tmp_path / "whole"), []
    rows = measure_reach(study(*pairs, seconds=3.0), cache)["rows"]
    assert rows[0]["apex_m"] <= rows[1]["apex_m"]
    assert rows[1]["apex_m"] > 0.3
    cut = ResultCache(tmp_path / "cut", begun.append)
    measure_reach(study(pairs[0], seconds=3.0), cut)
    assert measure_reach(study(*pairs, seconds=3.0), cut)["rows"] == rows
    assert begun == ["6 and 6 N m", "6 and 12 N m"]


def test_without_torque_there_is_no_hop_and_progress_is_told(tmp_path):
    told = []
    weak = study((1e-3, 1e-3), (2e-3, 1e-3))
    rows = measure_reach(weak, ResultCache(tmp_path), lambda n, all_: told.append((n, all_)))
    assert [row["apex_m"] for row in rows["rows"]] == [0.0, 0.0]
    assert told == [(n, 8) for n in range(1, 9)]
