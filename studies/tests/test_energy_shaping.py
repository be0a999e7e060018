"""Parts of energy shaping are taken away one at a time; gains are searched where costs are low."""

import json
from dataclasses import replace

import numpy as np
import pytest

from hopping_leg.controllers import RolloutConfig
from hopping_leg.controllers.energy_shaping.gains import GainFile, load_gains, scale_gains
from hopping_leg.errors import UsageError
from hopping_leg.robot import load_robot
from hopping_leg.sim.randomization import draw_twin
from studies.energy_shaping import run as module
from studies.energy_shaping import tune
from studies.energy_shaping.run import COMMANDS, RANGE, Baseline, cases
from studies.energy_shaping.tune import ON_TWINS, SPACE, Tune, calibrated, from_unit, to_unit
from studies.shared import main

ROBOT = load_robot("legv2-paper")
GAINS = load_gains().gains
SETUP = RolloutConfig(ROBOT, threads=1)


def test_the_law_itself_meets_the_commands(monkeypatch):
    names = ("paper, true contact and height", "paper, push until contact is lost", "tuned")
    some = [case for case in cases(ROBOT) if case.name in names]
    monkeypatch.setattr(module, "cases", lambda _: some)
    found = Baseline(ROBOT.name, runs=2, duration=4.0).measure()
    law, late, _ = (next(c for c in found["cases"] if c["case"] == name) for name in names)
    assert law["worst_median_error_m"] < 0.002
    assert law["skipped_hops"] == 0
    assert late["mean_abs_median_error_m"] > 3 * law["mean_abs_median_error_m"]
    heights = [row["command_m"] for row in found["commands"]]
    assert sorted(heights) == sorted([*COMMANDS, *COMMANDS, *RANGE])


def test_errors_are_those_of_the_papers_heights_and_faults_those_of_all():
    nothing = {"hop_rate_hz": 2.0, "min_base_height_m": 0.1, "body_contacts": 1, "hops": 5}
    rows = [
        {"command_m": c, "median_error_m": c - 0.27, "std_m": c / 10, "skipped_hops": 1} | nothing
        for c in RANGE
    ]
    rows[-2] |= {"hops": 0, "std_m": None}
    found = module.summary(cases(ROBOT)[0], rows)
    assert found["mean_abs_median_error_m"] == pytest.approx((0.02 + 0.03 + 0.08) / 3)
    assert found["worst_median_error_m"] == pytest.approx(0.08)
    assert found["mean_std_m"] == pytest.approx(0.03)
    assert (found["skipped_hops"], found["body_contacts"]) == (len(RANGE), len(RANGE))
    assert found["commands_without_hops"] == 1


def scores(shift=0.0, scale=1.0, **changed):
    usual = tune.CommandScore(0.3, 0.3, 0.002, 2.0, 0.0, 0.4, 0.03, 0.08)
    medians = {c: 0.3 + shift + scale * (c - 0.3) for c in Tune().commands}
    return [replace(usual, **{"command": c, "median": m} | changed) for c, m in medians.items()]


@pytest.mark.parametrize(("space", "name"), [(SPACE, None), (ON_TWINS, "energy-shaping-tuned")])
def test_unit_cube_round_trip_and_shipped_gains_lie_in_the_box(space, name):
    point, gains = np.linspace(0.1, 0.9, len(space)), load_gains(name).gains if name else GAINS
    np.testing.assert_allclose(to_unit(from_unit(point, gains, space), space), point)
    assert vars(from_unit(to_unit(gains, space), gains, space)) == pytest.approx(vars(gains))


def test_cost_ignores_what_calibration_removes_and_counts_the_rest():
    alone, many = Tune().cost, Tune(twins=2).cost
    assert alone(scores(shift=0.02, scale=0.9)) == pytest.approx(alone(scores()))
    assert many(scores(scale=0.5)) == pytest.approx(2 * many(scores())), "it is stretched"
    for cost in (alone, many):
        for worse in ({"std": 0.010}, {"rate": 0.5}, {"knee_clearance": -0.01}):
            assert cost(scores(**worse)) > cost(scores()) + 7, worse
        assert cost(scores(median=float("nan"))) > 100
    assert many(scores(skipped=0.1)) == pytest.approx(many(scores()) + 10)
    assert Tune(flight=0.5).cost(scores(flight=0.3)) == pytest.approx(alone(scores()) + 20)
    found = calibrated(GAINS, scores(shift=0.01, scale=1.1))
    assert found.height_scale == pytest.approx(1.1 * GAINS.height_scale)
    assert found.height_offset == pytest.approx(0.01 + 1.1 * GAINS.height_offset)


def scored_by_exponent(monkeypatch):
    """Let no leg hop: an exponent of 1 is best; return the seeds of noise and delay, live."""
    seeds = []

    def scored(candidates, setup, commands, seconds, seed, legs):
        seeds.append(seed)
        return [scores(std=abs(g.exponent - 1.0) + 0.001) for g in candidates]

    monkeypatch.setattr(tune, "evaluate", scored)
    return seeds


def test_a_search_goes_down_and_on_where_it_was(tmp_path, monkeypatch):
    seeds = scored_by_exponent(monkeypatch)
    start, search = replace(GAINS, exponent=1.9), Tune(generations=15, seed=3, out=tmp_path)
    found = search.search(start, SETUP)
    assert abs(found.exponent - 1.0) < 0.3
    (tmp_path / "generations" / "7.json").unlink()
    seeds.clear()
    assert search.search(start, SETUP) == found
    assert seeds == [7]


def test_candidates_are_judged_side_by_side():
    useless = replace(GAINS, k0=0.3, exponent=0.0)
    commands = (0.25, 0.30, 0.35)
    good, bad = tune.evaluate([GAINS, useless], SETUP, commands, 3.5, 0, [ROBOT])
    assert Tune().cost(good) < Tune().cost(bad)
    assert tuple(score.command for score in good) == commands


def test_a_set_of_legs_is_hopped_on_at_once_and_what_differs_between_them_is_scatter():
    light = replace(ROBOT, base=replace(ROBOT.base, mass=0.7 * ROBOT.base.mass))
    (alone,) = tune.evaluate([GAINS], SETUP, (0.3,), 3.5, 0, [ROBOT])
    (mixed,) = tune.evaluate([GAINS], SETUP, (0.3,), 3.5, 0, [ROBOT, light])
    assert mixed[0].std > alone[0].std
    drawn = Tune(robot="legv2", twins=2, seed=500).legs
    assert drawn == tuple(draw_twin(seed).robot for seed in (500, 501))


def test_the_command_writes_gains_that_say_how_they_were_found(tmp_path, monkeypatch):
    scored_by_exponent(monkeypatch)
    words = ["--robot", "legv2", "--generations", "1", "--population", "4", "--out", str(tmp_path)]
    assert main("energy_shaping.tune", Tune, [*words, "--json", str(tmp_path / "t.json")]) == 0
    found = json.loads((tmp_path / "t.json").read_text())
    stored = load_gains(tmp_path / "gains.toml")
    assert vars(stored.gains) == pytest.approx(found["gains"])
    assert stored.robot == "legv2"
    assert "energy_shaping.tune --robot legv2 --generations 1" in stored.source


def test_gains_survive_a_file_and_a_bad_one_is_named(tmp_path):
    stored = GainFile("legv2", 'a "quoted" search', replace(GAINS, k0=1.25, exponent=0.5))
    tune.save_gains(tmp_path / "g.toml", stored)
    assert load_gains(tmp_path / "g.toml") == stored
    (tmp_path / "g.toml").write_text('robot = "a"\nsource = "b"\n[gains]\nk_0 = 1.0')
    for name, said in (("g.toml", "g.toml.*k_0"), ("missing.toml", r"energy_shaping\.tune")):
        with pytest.raises(UsageError, match=said):
            load_gains(tmp_path / name)


def test_forces_scale_with_mass_alone_and_on_the_same_leg_nothing_changes():
    heavy = replace(ROBOT.base, mass=ROBOT.base.mass + ROBOT.mass)
    assert vars(scale_gains(GAINS, ROBOT, ROBOT)) == pytest.approx(vars(GAINS))
    scaled = scale_gains(GAINS, ROBOT, replace(ROBOT, base=heavy))
    assert scaled.touchdown_stiffness == pytest.approx(2 * GAINS.touchdown_stiffness)
    assert scaled.liftoff_length == pytest.approx(GAINS.liftoff_length)
    assert scaled.knee_stiffness == pytest.approx(GAINS.knee_stiffness)
