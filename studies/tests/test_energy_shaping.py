"""Parts of energy shaping are taken away one at a time, on one leg and with one noise."""

import pytest

from hopping_leg.robot import DEFAULT_ROBOT, load_robot
from studies.energy_shaping import run as module
from studies.energy_shaping.run import COMMANDS, RANGE, Baseline, cases
from studies.shared import main

ROBOT = load_robot("legv2-paper")
TRUE = "paper, true contact and height"


def measured(monkeypatch, *names):
    some = [case for case in cases(ROBOT) if case.name in names]
    monkeypatch.setattr(module, "cases", lambda _: some)
    return Baseline(ROBOT.name, runs=2, duration=6.0, threads=1).measure()


def test_every_case_is_another():
    found = cases(load_robot(DEFAULT_ROBOT))
    told = {
        (repr(c.controller.gains), c.controller.options, c.controller.period, c.robot.digest,
         c.disturbance, tuple(c.commands))
        for c in found
    }  # fmt: skip
    assert len({case.name for case in found}) == len(told) == len(found)


def test_the_law_itself_meets_the_commands_and_a_push_until_contact_is_lost_does_not(monkeypatch):
    lost = "paper, push until contact is lost"
    found = measured(monkeypatch, TRUE, lost)
    law, late = found["cases"]
    assert (law["case"], late["case"]) == (TRUE, lost)
    assert law["worst_median_error_m"] < 0.002
    assert law["skipped_hops"] == 0
    assert late["mean_abs_median_error_m"] > 3 * law["mean_abs_median_error_m"]
    assert [row["command_m"] for row in found["commands"]] == [*COMMANDS, *COMMANDS]
    assert not found["estimators"], "the law with the truth estimates nothing"


def test_the_tuned_case_tells_of_more_heights_and_of_its_estimates(monkeypatch):
    found = measured(monkeypatch, "tuned")
    assert [row["command_m"] for row in found["commands"]] == list(RANGE)
    used, raw, _ = found["estimators"]
    assert used["estimate"] == "as used"
    assert abs(used["mean_m"]) < abs(raw["mean_m"])
    assert found == measured(monkeypatch, "tuned")


def test_errors_are_those_of_the_papers_heights_and_faults_those_of_all():
    nothing = {"hop_rate_hz": 2.0, "min_base_height_m": 0.1, "body_contacts": 1, "hops": 5}
    rows = [
        {"command_m": c, "median_error_m": c - 0.27, "std_m": c / 10, "skipped_hops": 1} | nothing
        for c in RANGE
    ]
    rows[-2] |= {"hops": 0, "std_m": None}
    found = module._summary(cases(ROBOT)[0], rows)
    assert found["mean_abs_median_error_m"] == pytest.approx((0.02 + 0.03 + 0.08) / 3)
    assert found["worst_median_error_m"] == pytest.approx(0.08)
    assert found["mean_std_m"] == pytest.approx(0.03)
    assert (found["skipped_hops"], found["body_contacts"]) == (len(RANGE), len(RANGE))
    assert found["commands_without_hops"] == 1


def test_a_senseless_duration_is_refused(capsys):
    assert main("energy_shaping", Baseline, ["--duration", "3"]) == 2
    assert main("energy_shaping", Baseline, ["--runs", "0"]) == 2
    assert capsys.readouterr().err.count("must") == 2
