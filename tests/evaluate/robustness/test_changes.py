"""Hops are counted from the first landing after a change; back means back for good."""

import numpy as np
import polars as pl
import pytest

from hopping_leg.evaluate.robustness import changes
from hopping_leg.evaluate.robustness.changes import CHANGES, hops_after, study_changes
from hopping_leg.trace import Trace


def bouncing(apexes, ticks=100):
    """A trace of parabolic hops, each of so many ticks, on the ground in between."""
    place = np.linspace(-1, 1, ticks)
    height = np.concatenate([np.maximum(a - 0.2 * place**2, 0.2) for a in apexes])
    columns = {
        "time_s": np.arange(len(height)) / 200,
        "height_m": height,
        "height_rate_m_s": np.gradient(height) * 200,
        "foot_clearance_m": height - 0.2,
    }
    return Trace(pl.DataFrame(columns), {})


@pytest.mark.parametrize(("tick", "first"), [(100, 1), (140, 2), (160, 2), (195, 2)])
def test_a_flight_under_way_does_not_count(tick, first):
    apexes = [0.30, 0.31, 0.32, 0.33]
    found = hops_after(bouncing(apexes), tick)
    assert found == pytest.approx(apexes[first:], abs=1e-3)


def test_a_leg_that_stays_down_has_no_hops():
    assert len(hops_after(bouncing([0.3, 0.19, 0.19]), 110)) == 0


def test_a_leg_that_hops_no_more_is_not_left_out():
    hops, stays = bouncing([0.3] * 9), bouncing([0.3, 0.3, 0.3, 0.19, 0.19, 0.19, 0.19, 0.19, 0.19])
    run = changes._Run("", 0.3, 0.3)
    change = 110
    both = changes._recovery(run, [hops, stays, stays], change)
    assert both["hop_errors_m"][-1] == pytest.approx(stays.column("height_m")[0] - 0.3)
    assert both["back_after_hops"] is None
    assert changes._step(run, [stays], change)["settled_after_hops"] is None


@pytest.mark.parametrize(
    ("sizes", "hops"),
    [
        ([0.0, 0.0], 0),
        ([0.02, 0.0], 1),
        ([0.02, 0.0, 0.011, 0.01], 3),
        ([0.0, 0.011], None),
        ([-0.02, -0.01, 0.01], 1),
        ([0.0, -0.011], None),
    ],
)
def test_back_means_back_for_good(sizes, hops):
    assert changes._back(sizes) == hops


def test_every_change_and_step_has_a_row(setup, spring, monkeypatch):
    monkeypatch.setattr(changes, "SECONDS", 3.0)
    monkeypatch.setattr(changes, "AT", 1.5)
    study = study_changes(spring, setup, (0.28, 0.32), 1, 1000)
    rows = study["recovery"]
    assert [(r["change"], r["command_m"]) for r in rows] == [
        (change, command) for change in CHANGES for command in (0.28, 0.32)
    ]
    for row in rows:
        assert len(row["hop_abs_errors_m"]) == len(row["hop_errors_m"]) == 5
        for size, centre in zip(row["hop_abs_errors_m"], row["hop_errors_m"], strict=True):
            assert abs(centre) == size, "one run alone has one error"
    assert len({repr(row["hop_abs_errors_m"]) for row in rows}) == len(rows)
    assert [(s["from_m"], s["to_m"]) for s in study["steps"]] == [(0.28, 0.32), (0.32, 0.28)]
    assert study == study_changes(spring, setup, (0.28, 0.32), 1, 1000)


def test_a_changed_leg_is_another_one(robot):
    others = [alter(robot) for alter in CHANGES.values()]
    assert len({other.digest for other in others} | {robot.digest}) == len(CHANGES) + 1
    assert CHANGES["payload -20 %"](robot).mass == pytest.approx(0.8 * robot.mass)
    assert CHANGES["delay +5 ms"](robot).reality.latency.command == 0.005
