"""What a campaign of faults draws, whom it judges and how, and that it finds unsafe hosts out."""

import dataclasses
import json
import math
from types import SimpleNamespace

import numpy as np
import pytest

from hopping_leg.controllers.registry import robot_of
from hopping_leg.deploy import loop
from hopping_leg.deploy.drive_link import Action, DriveCommand, DriveMode
from hopping_leg.deploy.flight_recorder import FlightRecorder
from hopping_leg.emulator.faults import KINDS
from hopping_leg.flight_recording import SUFFIX
from studies.fault_campaign.campaign import Faults, play_case
from studies.fault_campaign.case import Case
from studies.fault_campaign.families import FAMILIES, HOP_SECONDS
from studies.fault_campaign.live import LIVE, gave_up
from studies.fault_campaign.safety_case import rows, upper_bound
from studies.fault_campaign.verdict import Limits, problems_of_commands, reaction, restarts
from studies.fault_campaign.wire_log import CommandEvent, ReplyEvent
from studies.shared import main

LIMITS = Limits((10.0, 10.0), (18.0, 42.0), 65.0)


@pytest.mark.parametrize("name", FAMILIES)
def test_a_family_draws_the_same_from_the_same_seed_and_much_else_from_others(name):
    family = FAMILIES[name]
    mishaps = [family.draw(np.random.default_rng(seed)) for seed in range(40)]
    assert family.draw(np.random.default_rng(0)) == mishaps[0]
    assert len({str(mishap) for mishap in mishaps}) > 10
    for m in mishaps:
        assert 0 <= m.at <= HOP_SECONDS
        assert m.faults or m.start or m.stall or m.dies or m.health
        assert (m.start is not None) == (family.refused or family.grounded)
    assert family.reasons or family.refused or name == "killed host"


def test_every_kind_of_the_emulators_faults_is_in_a_family():
    kinds = set()
    for family in FAMILIES.values():
        for seed in range(20):
            mishap = family.draw(np.random.default_rng(seed))
            faults = mishap.start.faults if mishap.start else mishap.faults
            kinds |= {fault.kind for fault in faults}
    assert kinds == set(KINDS)
    assert set(LIVE) <= set(FAMILIES)


def test_the_command_goes_on_and_writes_the_summary(tmp_path, capsys):
    file, out = tmp_path / "faults.json", tmp_path / "out"
    words = ["--families", "wrong configuration", "wrong boot pose", "--live", "0"]
    words += ["--controllers", "energy-shaping", "--workers", "1", "--seed", "1"]
    words += ["--out", str(out), "--json", str(file)]
    assert main("fault_campaign", Faults, [*words, "--repeats", "3"]) == 0
    result = json.loads(file.read_text())
    assert result["families"] == ["wrong configuration", "wrong boot pose"]
    assert (result["trials"], result["unsafe"], result["repeats"]) == (6, 0, 3)
    assert {"reaction_p99_s", "reaction_max_s", "rows", "unsafe_trials", "seed"} <= result.keys()
    assert "6 trials, 0 unsafe" in capsys.readouterr().out
    written = {path: path.stat().st_mtime_ns for path in out.iterdir()}
    next(iter(written)).unlink()
    assert main("fault_campaign", Faults, [*words, "--repeats", "3"]) == 0
    again = {path: path.stat().st_mtime_ns for path in out.iterdir()}
    assert sum(again[path] == written[path] for path in written) == 1
    assert main("fault_campaign", Faults, ["--repeats", "0"]) == 2
    assert main("fault_campaign", Faults, ["--families", "drive faults"]) == 2
    assert "Did you mean 'drive fault'" in capsys.readouterr().err


def test_an_interrupted_trial_is_no_result(monkeypatch):
    def interrupted(self):
        self.stop()
        return run(self)

    run = loop.ControlLoop.run
    monkeypatch.setattr(loop.ControlLoop, "run", interrupted)
    with pytest.raises(KeyboardInterrupt):
        play_case(Case("limit notice", "energy-shaping", "legv2-paper", 0, 0))


def test_a_trial_is_exact_and_the_mishap_the_same_for_all_controllers():
    case = Case("drive fault", "energy-shaping", robot_of(["fast"]), 0, 0)
    first, again = play_case(case), play_case(case)
    other = play_case(dataclasses.replace(case, controller="fast"))
    assert first | {"seconds": 0} == again | {"seconds": 0}
    assert first["problems"] == other["problems"] == []
    assert first["what"] == other["what"]
    assert first["reason"] == "DRIVE_FAULT"
    assert 0 < first["reaction"] <= 0.005


@pytest.mark.parametrize(
    ("torque", "word"), [((0.0, 0.0), "again"), ((99.0, 0.0), "99"), ((float("nan"), 0), "number")]
)
def test_an_unsafe_host_is_found_out(monkeypatch, torque, word):
    """One that, from time to time, sends a torque after the stop."""
    ticks, supervise = [], loop.supervise

    def spoiled(envelope, memory, seen):
        after, outgoing = supervise(envelope, memory, seen)
        ticks.append(after.state)
        stopped = outgoing.action is not Action.TORQUE and len(ticks) > 100
        return after, DriveCommand(Action.TORQUE, torque) if stopped and len(ticks) % 3 == 0 else (
            outgoing
        )

    monkeypatch.setattr(loop, "supervise", spoiled)
    row = play_case(Case("limit notice", "energy-shaping", "legv2-paper", 0, 0))
    assert any(word in problem for problem in row["problems"]), row["problems"]


def test_a_false_alarm_of_a_healthy_leg_is_a_problem(monkeypatch):
    monkeypatch.setattr("hopping_leg.deploy.plausibility._GIVEN", 2.0)
    row = play_case(Case("no fault", "energy-shaping", "legv2", 0, 0))
    assert row["reason"] == "TORQUE_FALSE"
    assert "the reason is TORQUE_FALSE" in row["problems"][0]


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES)
def test_a_trial_of_each_family_is_safe(family):
    for controller in ("rl", "energy-shaping"):
        row = play_case(Case(family, controller, robot_of([controller]), 1, 0))
        assert row["problems"] == [], row
        assert row["began"] is not None


@pytest.mark.slow
@pytest.mark.parametrize("family", ["drive fault", "killed host"])
def test_a_trial_in_real_time_is_safe(family):
    row = play_case(Case(family, "energy-shaping", "legv2-paper", 0, 0, live=True))
    late = "the drives did not brake in time after the host's death"
    assert set(row["problems"]) <= {late}, row
    assert row["disturbed"] or row["reason"] == "DRIVE_FAULT" or row["braked"] < 0.2


@pytest.mark.parametrize(("reason", "slow"), [("loop_stalled", True), ("drive_fault", False)])
def test_a_host_that_was_too_slow_had_given_up_before_its_death(tmp_path, reason, slow):
    assert not gave_up(tmp_path)
    box = FlightRecorder(tmp_path / f"run{SUFFIX}", ("time_s",), {})
    box.row((0.0,))
    box.event(reason=reason)
    box.close()
    assert gave_up(tmp_path) is slow
    (tmp_path / f"run{SUFFIX}").write_bytes(b"")
    assert not gave_up(tmp_path), "a host that left no readable box is judged"


def test_a_bound_of_a_rate_without_failures_is_that_of_the_binomial_distribution():
    for trials in (1, 20, 3000):
        assert (1 - upper_bound(trials, 0)) ** trials == pytest.approx(0.05)
    assert upper_bound(0, 0) is None
    assert upper_bound(100, 1) is None


def test_every_family_has_a_row_that_says_what_notices_it_and_what_follows():
    stored = {"family": "total loss", "trials": 30, "unsafe": 0, "reaction_p99_s": 0.02}
    case = {row["fault"]: row for row in rows({"rows": [{**stored, "braked_max_s": None}]})}
    assert list(case) == list(FAMILIES)
    assert all(row["noticed_by"] and row["follows"] for row in case.values())
    assert case["total loss"]["upper_bound"] == pytest.approx(0.095, abs=0.001)
    assert case["drive fault"]["trials"] == 0


def told(time, mode=DriveMode.POSITION, torque=1.0, most=10.0):
    return CommandEvent(time, 0, mode, torque, most)


def answered(time, mode=DriveMode.POSITION, voltage=24.0, temperature=30.0):
    return ReplyEvent(time, 0, mode, voltage, temperature)


def reaction_to(*entries, jumped=False):
    commands, answers = (
        [e for e in entries if isinstance(e, k)] for k in (CommandEvent, ReplyEvent)
    )
    log = SimpleNamespace(
        commands=commands, answers=lambda since: (e for e in answers if e.time >= since)
    )
    return reaction(log, LIMITS, 0.5, jumped=jumped)


@pytest.mark.parametrize(
    ("command", "word"),
    [
        (told(0.5, torque=math.nan), "no number"),
        (told(0.5, most=math.nan), "no number"),
        (told(0.5, torque=-10.1), "limit 10"),
        (told(0.5, most=11.0), "limit 10"),
    ],
)
def test_every_unsafe_command_is_found(command, word):
    healthy = [told(0.0, torque=10.0), told(0.1, torque=-10.0), told(0.2, DriveMode.BRAKE, 0, 0)]
    assert problems_of_commands(healthy, LIMITS) == []
    (problem, *_) = problems_of_commands([*healthy, command], LIMITS)
    assert word in problem


def test_torque_after_a_stop_is_a_restart_only_since_the_fault():
    before = [told(0.0, DriveMode.STOPPED), told(0.1)]
    assert restarts([*before, told(0.6, DriveMode.BRAKE), told(0.7, DriveMode.STOPPED)], 0.5) == []
    assert restarts([*before, told(0.6, DriveMode.BRAKE), told(0.7)], 0.5)


@pytest.mark.parametrize(
    "bad",
    [
        *(answered(1.0, mode) for mode in (DriveMode.FAULT, DriveMode.TIMEOUT)),
        *(answered(1.0, voltage=voltage) for voltage in (17.0, 43.0)),
        answered(1.0, temperature=math.nan),
    ],
)
def test_the_reaction_counts_from_the_first_bad_answer_to_the_first_safe_command(bad):
    later = answered(1.1, DriveMode.FAULT), told(1.0), told(1.003, DriveMode.BRAKE)
    assert reaction_to(answered(0.9), bad, *later) == pytest.approx(0.003)
    assert reaction_to(bad, told(1.1)) == math.inf, "nothing safe follows"


def test_answers_after_the_stop_and_at_the_instant_of_the_fault_are_not_reacted_to():
    entries = answered(0.9), told(1.0, DriveMode.BRAKE), answered(1.1, DriveMode.BRAKE)
    assert reaction_to(*entries) is None
    assert reaction_to(*entries, jumped=True) == pytest.approx(0.1)
    entries = answered(0.5), answered(0.505), told(0.5055, DriveMode.BRAKE)
    assert reaction_to(*entries, jumped=True) == pytest.approx(0.0005)
