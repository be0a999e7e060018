import dataclasses
import json

import pytest

from hopping_leg.controllers.registry import robot_of
from hopping_leg.deploy import loop
from hopping_leg.deploy.drive_link import Action, DriveCommand
from hopping_leg.errors import UsageError
from studies.fault_campaign.campaign import Campaign, Faults, play_case, run_campaign
from studies.fault_campaign.case import Case
from studies.fault_campaign.families import FAMILIES
from studies.fault_campaign.live import LIVE
from studies.shared import main

QUICK = Campaign(
    controllers=("energy-shaping",),
    families=("wrong configuration", "wrong boot pose"),
    repeats=3,
    live=0,
)


def comparable(rows):
    for row in rows:
        row.pop("seconds")
    return sorted(rows, key=lambda row: (row["family"], row["index"]))


def trials(folder):
    lines = (folder / "trials.jsonl").read_text().splitlines()
    return comparable([json.loads(line) for line in lines])


def test_an_interrupted_campaign_goes_on_and_nothing_else_differs(tmp_path):
    whole = run_campaign(QUICK, tmp_path / "whole", workers=1)
    assert (whole["trials"], whole["unsafe"]) == (6, 0)
    assert whole["families"] == list(QUICK.families)
    fewer = dataclasses.replace(QUICK, repeats=2)
    run_campaign(fewer, tmp_path / "cut", workers=1)
    file = tmp_path / "cut" / "trials.jsonl"
    file.write_bytes(file.read_bytes()[:-40])
    done = []
    resumed = run_campaign(
        QUICK, tmp_path / "cut", workers=1, on_trial=lambda *state: done.append(state)
    )
    assert done[0] == (3, 6, 0)
    assert done[-1] == (6, 6, 0)
    assert resumed["trials"] == 6
    assert trials(tmp_path / "cut") == trials(tmp_path / "whole")


def test_an_interrupted_trial_is_no_result(monkeypatch):
    def interrupted(self):
        self.stop()
        return run(self)

    run = loop.ControlLoop.run
    monkeypatch.setattr(loop.ControlLoop, "run", interrupted)
    with pytest.raises(KeyboardInterrupt):
        play_case(Case("limit notice", "energy-shaping", "legv2-paper", 0, 0))


def test_trials_of_another_leg_are_not_mixed(tmp_path):
    run_campaign(dataclasses.replace(QUICK, repeats=1), tmp_path, workers=1)
    with pytest.raises(UsageError, match="holds trials of another leg"):
        run_campaign(dataclasses.replace(QUICK, robot="legv1"), tmp_path, workers=1)


def test_unknown_families_are_named():
    with pytest.raises(UsageError, match="Did you mean 'drive fault'"):
        Campaign(families=("drive faults",))


def test_a_trial_is_exact_and_the_mishap_the_same_for_all_controllers():
    case = Case("drive fault", "energy-shaping", robot_of(["fast"]), 0, 0)
    first, again = play_case(case), play_case(case)
    other = play_case(dataclasses.replace(case, controller="fast"))
    assert comparable([first]) == comparable([again])
    assert first["problems"] == other["problems"] == []
    assert first["what"] == other["what"]
    assert first["reason"] == "DRIVE_FAULT"
    assert 0 < first["reaction"] <= 0.005


def unsafe(monkeypatch, change):
    """Spoil what leaves for the drives."""
    supervise = loop.supervise

    def spoiled(envelope, memory, seen):
        after, outgoing = supervise(envelope, memory, seen)
        return after, change(after, outgoing)

    monkeypatch.setattr(loop, "supervise", spoiled)


@pytest.mark.parametrize(
    ("torque", "word"), [((0.0, 0.0), "again"), ((99.0, 0.0), "99"), ((float("nan"), 0), "number")]
)
def test_an_unsafe_host_is_found_out(monkeypatch, torque, word):
    ticks = []

    def change(memory, outgoing):
        """From time to time, send a torque after the stop."""
        ticks.append(memory.state)
        stopped = outgoing.action is not Action.TORQUE and len(ticks) > 100
        if stopped and len(ticks) % 3 == 0:
            return DriveCommand(Action.TORQUE, torque)
        return outgoing

    unsafe(monkeypatch, change)
    row = play_case(Case("limit notice", "energy-shaping", "legv2-paper", 0, 0))
    assert any(word in problem for problem in row["problems"]), row["problems"]


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES)
def test_a_trial_of_each_family_is_safe(family):
    for controller in ("precise", "energy-shaping"):
        row = play_case(Case(family, controller, robot_of([controller]), 1, 0))
        assert row["problems"] == [], row
        assert row["began"] is not None


@pytest.mark.slow
@pytest.mark.parametrize("family", ["drive fault", "killed host"])
def test_a_trial_in_real_time_is_safe(family):
    assert family in LIVE
    row = play_case(Case(family, "energy-shaping", "legv2-paper", 0, 0, live=True))
    late = "the drives did not brake in time after the host's death"
    assert set(row["problems"]) <= {late}, row
    assert row["disturbed"] or row["reason"] == "DRIVE_FAULT" or row["braked"] < 0.2


def test_the_command_line_writes_the_summary(tmp_path, capsys):
    file = tmp_path / "faults.json"
    words = ["--families", "wrong configuration", "--controllers", "energy-shaping"]
    words += ["--repeats", "2", "--workers", "1", "--out", str(tmp_path / "out")]
    assert main("fault_campaign", Faults, [*words, "--json", str(file)]) == 0
    result = json.loads(file.read_text())
    assert result["families"] == ["wrong configuration"]
    assert (result["trials"], result["unsafe"]) == (2, 0)
    assert "reaction_p99_s" in result
    assert "2 trials, 0 unsafe" in capsys.readouterr().out
    assert main("fault_campaign", Faults, ["--repeats", "0"]) == 2
