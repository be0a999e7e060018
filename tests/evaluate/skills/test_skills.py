"""Skills are measured against the true state, and the measures see what they should see."""

import dataclasses

import numpy as np
import polars as pl
import pytest

from hopping_leg.controllers.registry import load_controller
from hopping_leg.errors import UsageError
from hopping_leg.evaluate import Entry
from hopping_leg.evaluate.skills.counted import count_hops
from hopping_leg.evaluate.skills.landings import ground_force, land, last_touchdown, rebound
from hopping_leg.evaluate.skills.stairs import climb
from hopping_leg.evaluate.skills.suite import run_skills
from hopping_leg.trace import Trace


@pytest.fixture
def shaping(robot):
    return load_controller("energy-shaping", robot)


def trace_of(height, clearance, rate=200.0):
    count = len(height)
    columns = {"height_m": height, "foot_clearance_m": clearance}
    columns |= {f"{j}_position_rad": np.full(count, v) for j, v in (("hip", 0.7), ("knee", -1.4))}
    return Trace(pl.DataFrame({"time_s": np.arange(count) / rate, **columns}))


def test_force_of_ground_is_weight_at_rest_and_nothing_in_a_fall(robot):
    time = np.arange(40) / 200
    still = ground_force(robot, trace_of(np.full(40, 0.3), np.zeros(40)))
    falling = ground_force(robot, trace_of(1 - 0.5 * 9.81 * time**2, np.ones(40)))
    np.testing.assert_allclose(still[1:-1], robot.mass * 9.81)
    np.testing.assert_allclose(falling[1:-1], 0, atol=1e-6)


def test_rebound_is_what_rises_above_rest():
    height = np.array([0.4, 0.2, 0.1, 0.2, 0.25, 0.18, 0.2, 0.2])
    clear = np.array([0.1, -0.01, -0.02, 0.0, 0.03, -0.01, -0.01, -0.01])
    trace = trace_of(height, clear)
    assert rebound(trace, 1) == (pytest.approx(0.05), pytest.approx(0.03))
    assert rebound(trace, 5) == (0.0, 0.0)
    assert last_touchdown(trace) == 5


def test_landing_is_softer_than_a_pd(setup):
    landing, held = land(setup, drop=0.1, repeats=3, seed=4)
    assert (landing.controller, held.controller) == ("landing", "joint-pd")
    assert landing.peak_force < 0.8 * held.peak_force
    assert landing.peak_knee_torque_nm < held.peak_knee_torque_nm
    assert landing.rebound_m < held.rebound_m
    assert landing.body_contacts == 0
    assert 1 < landing.peak_force <= landing.worst_force


@pytest.mark.slow
def test_energy_shaping_counts_and_climbs(setup, shaping):
    single, several = count_hops(shaping, setup, [0.3], repeats=2, seed=1)
    assert (single.asked, several.asked) == (1, 5)
    for row in (single, several):
        assert row.exact == row.at_rest == 1
        assert row.fewest == row.most == row.asked
        assert abs(row.median_error_m) < 0.03
    rows, (whole,) = climb(shaping, setup, [0.3], stairs=[0, 0.02, 0], repeats=2, seed=1)
    assert [row.ground_m for row in rows] == [0, 0.02, 0]
    assert all(abs(row.median_error_m) < 0.01 and row.hops >= 3 for row in rows)
    assert whole.skipped_hops == 0
    assert abs(whole.worst_error_m) == max(abs(row.median_error_m) for row in rows)


def test_skills_need_the_stepper(setup, shaping):
    with pytest.raises(UsageError, match="stepper"):
        run_skills([Entry("es", shaping)], dataclasses.replace(setup, engine="pybullet"))
