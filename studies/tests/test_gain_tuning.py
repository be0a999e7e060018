from dataclasses import replace

import numpy as np
import pytest

from hopping_leg.controllers import RolloutConfig
from hopping_leg.controllers.energy_shaping import tuned_energy_shaping
from hopping_leg.controllers.energy_shaping.gains import (
    GainFile,
    ShapingGains,
    load_gains,
    save_gains,
    scale_gains,
)
from hopping_leg.errors import UsageError
from hopping_leg.robot import load_robot
from studies.energy_shaping import tuning
from studies.energy_shaping.tuning import calibrated, cost, from_unit, to_unit

GAINS = load_gains().gains
ROBOT = load_robot("legv2-paper")
SETUP = RolloutConfig(ROBOT, threads=1)


def scores(shift=0.0, scale=1.0, **changed):
    usual = tuning.CommandScore(0.3, 0.3, 0.002, 2.0, 0.4, 0.03, 0.08)
    medians = {c: 0.3 + shift + scale * (c - 0.3) for c in tuning.Search().commands}
    return [replace(usual, **{"command": c, "median": m} | changed) for c, m in medians.items()]


def fake_evaluate(candidates, setup, commands, seconds, seed):
    return [scores(std=abs(g.exponent - 1.0) + 0.001) for g in candidates]


def searched(start, log, generations=15, seed=3, **options):
    search = tuning.Search(generations=generations, **options)
    return tuning.search(start, SETUP, search, seed, log, lambda done, lowest: None)


def test_unit_cube_round_trip_and_shipped_gains_lie_in_the_box():
    point = np.linspace(0.1, 0.9, len(tuning.SPACE))
    np.testing.assert_allclose(to_unit(from_unit(point, GAINS)), point)
    assert vars(from_unit(to_unit(GAINS), GAINS)) == pytest.approx(vars(GAINS))


def test_cost_ignores_what_calibration_removes_and_counts_the_rest():
    assert cost(scores(shift=0.02, scale=0.9)) == pytest.approx(cost(scores()))
    for worse in ({"std": 0.010}, {"rate": 0.5}, {"knee_clearance": -0.01}):
        assert cost(scores(**worse)) > cost(scores()) + 7, worse
    assert cost(scores(median=float("nan"))) > 100
    assert cost(scores(flight=0.3), 0.5) == pytest.approx(cost(scores()) + 20)
    assert cost(scores(flight=0.6), 0.5) == pytest.approx(cost(scores(flight=0.1)))


def test_calibration_moves_the_estimate_by_what_the_medians_missed():
    found = calibrated(GAINS, scores(shift=0.01, scale=1.1))
    assert found.height_scale == pytest.approx(1.1 * GAINS.height_scale)
    assert found.height_offset == pytest.approx(0.01 + 1.1 * GAINS.height_offset)


def test_search_goes_down_and_resumes_without_simulating(tmp_path, monkeypatch):
    monkeypatch.setattr(tuning, "evaluate", fake_evaluate)
    start, log = replace(GAINS, exponent=1.9), tmp_path / "log.jsonl"
    found = searched(start, log)
    assert abs(found.exponent - 1.0) < 0.3
    lines = log.read_text().splitlines()
    log.write_text("\n".join(lines[:7]) + "\n" + lines[7][:20])
    assert searched(start, log) == found
    monkeypatch.setattr(tuning, "evaluate", None)
    assert searched(start, log) == found


def test_log_of_another_search_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(tuning, "evaluate", fake_evaluate)
    log = tmp_path / "log.jsonl"
    searched(GAINS, log, 1)
    for other in ({"seed": 4}, {"flight": 0.5}, {"commands": (0.2, 0.3, 0.4)}):
        with pytest.raises(UsageError, match=r"seed 3, .* flight 0 and commands 0.22 .* 0.4;"):
            searched(GAINS, log, 1, **other)


def test_candidates_are_judged_side_by_side():
    useless = replace(GAINS, k0=0.3, exponent=0.0)
    commands = (0.25, 0.30, 0.35)
    good, bad = tuning.evaluate([GAINS, useless], SETUP, commands, 3.5, 0)
    assert cost(good) < cost(bad)
    assert tuple(score.command for score in good) == commands


def test_candidates_are_tried_at_the_heights_that_are_asked_for(tmp_path, monkeypatch):
    asked = []

    def evaluate(candidates, setup, commands, seconds, seed):
        asked.append(commands)
        return fake_evaluate(candidates, setup, commands, seconds, seed)

    monkeypatch.setattr(tuning, "evaluate", evaluate)
    search = tuning.Search(generations=1, population=4, commands=(0.2, 0.3, 0.4))
    tuning.tune(SETUP.robot, "legv2-paper", "by-hand", search, 0, tmp_path, lambda *_: None)
    assert set(asked) == {(0.2, 0.3, 0.4)}
    assert "--commands 0.2 0.3 0.4" in load_gains(tmp_path / "gains.toml").source
    for wrong in ((0.2, 0.3), (0.2, 0.3, -0.4)):
        with pytest.raises(UsageError, match="at least three --commands"):
            tuning.Search(commands=wrong)


def test_gains_survive_a_file_and_a_bad_one_is_named(tmp_path):
    stored = GainFile("legv2", 'a "quoted" search', ShapingGains(k0=1.25, exponent=0.5))
    save_gains(tmp_path / "g.toml", stored)
    assert load_gains(tmp_path / "g.toml") == stored
    (tmp_path / "g.toml").write_text('robot = "a"\nsource = "b"\n[gains]\nk_0 = 1.0')
    for name, said in (("g.toml", "g.toml.*k_0"), ("missing.toml", r"energy_shaping\.tune")):
        with pytest.raises(UsageError, match=said):
            load_gains(tmp_path / name)


def test_a_leg_gets_the_gains_that_were_tuned_on_it_and_they_say_how():
    for name in ("energy-shaping", "energy-shaping-flying"):
        own, stored = (
            tuned_energy_shaping(load_robot("legv2"), gains=name),
            load_gains(f"{name}-legv2"),
        )
        assert (own.name, own.gains) == (name, stored.gains)
        assert stored.robot == "legv2"
        assert stored.source
    assert load_robot(load_gains("by-hand").robot).mass > 0


def test_forces_scale_with_mass_alone_and_on_the_same_leg_nothing_changes():
    gains, heavy = load_gains().gains, replace(ROBOT.base, mass=ROBOT.base.mass + ROBOT.mass)
    assert vars(scale_gains(gains, ROBOT, ROBOT)) == pytest.approx(vars(gains))
    scaled = scale_gains(gains, ROBOT, replace(ROBOT, base=heavy))
    assert scaled.touchdown_stiffness == pytest.approx(2 * gains.touchdown_stiffness)
    assert scaled.liftoff_length == pytest.approx(gains.liftoff_length)
    assert scaled.knee_stiffness == pytest.approx(gains.knee_stiffness)
