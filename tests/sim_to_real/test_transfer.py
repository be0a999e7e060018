"""The tables say what came out."""

import dataclasses
import json
import os
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest

from hopping_leg.errors import RobotError, UsageError
from hopping_leg.evaluate import motor_load
from hopping_leg.robot import load_robot
from hopping_leg.sim_to_real import jobs, transfer
from hopping_leg.sim_to_real.jobs import Board, Job, work
from hopping_leg.sim_to_real.methods import METHODS, choose_methods
from hopping_leg.sim_to_real.study import TwinFile, find_twins
from hopping_leg.sim_to_real.transfer import compare
from tests.sim_to_real.studies import study

LOAD = dataclasses.asdict(motor_load.unknown())


def trials(errors, commands=(0.25, 0.35), **more):
    """Return trial rows from errors[method][twin][command]."""
    return [
        {
            "method": method, "twin": twin, "seed": 0, "command_m": command,
            "median_error_m": float(error), "median_abs_error_m": abs(float(error)),
            "std_m": 0.001, "hops": 10, "skipped_hops": 1, "body_contacts": 0,
            "missed_runs": 0, "motionless": False, **LOAD, **more,
        }
        for method, twins in errors.items()
        for twin, of_commands in twins.items()
        for command, error in zip(commands, of_commands, strict=True)
    ]  # fmt: skip


ERRORS = {
    "identified": {"a": (0.01, -0.02), "b": (0.02, 0.03), "c": (0.03, 0.04)},
    "cad": {"a": (0.03, -0.06), "b": (0.06, 0.09), "c": (-0.09, -0.12)},
}


def test_rows_are_medians_over_twins_with_intervals_around_them_if_there_are_twenty():
    rows = [r for r in trials(ERRORS) if r["method"] == "identified" and r["command_m"] == 0.35]
    row = transfer._pooled(METHODS["identified"], rows)
    assert row["median_abs_error_m"] == pytest.approx(0.03)
    assert row["median_error_m"] == pytest.approx(0.03)
    assert row["worst_abs_error_m"] == pytest.approx(0.04)
    assert np.isnan(row["median_abs_error_low_m"])
    assert (row["hops"], row["skipped_hops"], row["policies"]) == (30, 3, 3)
    errors = {"identified": {f"twin-{k}": (0.001 * (k + 1), 0.02) for k in range(20)}}
    row = transfer._pooled(METHODS["identified"], trials(errors)[::2])
    assert 0.004 < row["median_abs_error_low_m"] < 0.0105 < row["median_abs_error_high_m"] < 0.017


def test_the_ratio_meets_the_same_twins():
    errors = {"identified": {}, "cad": {}}
    for k in range(20):
        errors["identified"][f"twin-{k}"] = (0.001 * (k + 1), 0.002 * (k + 1))
        errors["cad"][f"twin-{k}"] = (0.003 * (k + 1), -0.006 * (k + 1))
    found = compare("identified", "cad", trials(errors), 0)
    assert found["ratio"] == pytest.approx(3.0)
    assert found["ratio_low"] == pytest.approx(3.0)
    assert found["ratio_high"] == pytest.approx(3.0)
    assert found["least_ratio_of_a_command"] == pytest.approx(3.0)


def test_order_is_of_the_apexes_and_a_leg_that_stands_has_none(tmp_path):
    one = study(tmp_path, ("identified",), commands=(0.25, 0.35))
    method = one.methods[0]
    rows = trials({"identified": {"a": (0.0, -0.099), "b": (0.06, -0.05), "c": (0.0, 0.0)}})
    assert transfer._whole(method, rows, one)["ordered"] == 2
    for row in rows[-2:]:
        row["motionless"] = True
    assert transfer._whole(method, rows, one)["ordered"] == 1


def test_of_several_trainings_the_better_one_is_chosen_in_its_own_simulation_alone(tmp_path):
    one = study(tmp_path, seeds=(0, 1), commands=(0.25, 0.35))
    good, bad = (0.01, 0.01), (0.1, 0.1)
    rows = []
    for method in one.methods:
        for number, twin in enumerate(one.twins):
            best = number if method.of_twin else 1
            for seed in one.seeds:
                folder = one.training(twin, method, seed)
                folder.mkdir(parents=True, exist_ok=True)
                selected = {"selected": {"score_m": 0.002 if seed == best else 0.3}}
                (folder / "result.json").write_text(json.dumps(selected))
                errors = {method.name: {twin.name: bad if seed == best else good}}
                rows += [{**row, "seed": seed} for row in trials(errors)]
    (found,) = transfer._best_in_own_simulation(rows, one).values()
    assert [row["policies"] for row in found["methods"]] == [2, 2]
    assert [row["worst_abs_error_m"] for row in found["methods"]] == [0.1, 0.1]
    assert found["comparison"][0]["ratio"] == pytest.approx(1.0)
    assert transfer._best_in_own_simulation(rows, study(tmp_path)) == {}


def test_drawn_twins_are_the_same_each_time_and_believed_to_be_the_cad(tmp_path):
    one, again = (find_twins(["2"], tmp_path) for _ in range(2))
    assert one == again
    assert [twin.believed for twin in one] == ["legv2", "legv2"]
    assert one[0].robot.digest != one[1].robot.digest
    assert not one[0].robot.reality.only_delays


def test_anyone_can_bring_a_twin(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text('name = "mine"\nextends = "legv2-paper"\n')
    (twin, shipped) = find_twins([str(file), "twin"], tmp_path)
    assert (twin.name, twin.believed) == ("mine", "legv2-paper")
    assert shipped.name == "twin"
    for words, error in (
        (["0"], "too few"),
        (["legv2"], "extends no robot"),
        ([str(file), str(file)], "Two twins are called 'mine'"),
        (["legv9"], "There is no robot"),
    ):
        with pytest.raises((UsageError, RobotError), match=error):
            find_twins(words, tmp_path)


def test_a_twin_file_knows_who_it_is():
    twin = TwinFile("twin", "twin", "legv2-paper")
    assert twin.robot == load_robot("twin")
    assert twin.without_surprises.reality.only_delays
    hip = twin.without_surprises.hip
    assert replace(load_robot("legv2-paper").hip, armature=hip.armature) == hip


def test_trainings_that_do_not_depend_on_the_twin_are_shared(tmp_path):
    one = study(tmp_path, ("identified", "cad", "randomised"))
    folders = {m.name: {one.training(t, m, 0) for t in one.twins} for m in one.methods}
    assert {name: len(found) for name, found in folders.items()} == {
        "identified": 2, "cad": 1, "randomised": 1,
    }  # fmt: skip
    assert len(set.union(*folders.values())) == 4


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"seconds": 5.0}, "too short"),
        ({"steps": 0}, "at least 1"),
        ({"seeds": ()}, "each given once"),
        ({"seeds": (1, 1)}, "each given once"),
        ({"seeds": (-1,)}, "each given once"),
    ],
)
def test_options_without_meaning_are_refused(tmp_path, options, says):
    with pytest.raises(UsageError, match=says):
        study(tmp_path, **options)


def test_methods_are_checked():
    with pytest.raises(UsageError, match="Did you mean 'identified'"):
        choose_methods(["identifed"])
    with pytest.raises(UsageError, match="named twice"):
        choose_methods(["cad", "cad"])
    with pytest.raises(UsageError, match="No method"):
        choose_methods([])


@dataclasses.dataclass(frozen=True)
class Note(Job):
    """A job that writes down which process did it."""

    file: Path
    seconds: float = 0.0
    weight: ClassVar[float] = 1.0

    @property
    def name(self):
        return self.file.stem

    @property
    def done(self):
        return self.file.exists()

    def run(self, *, quiet):
        time.sleep(self.seconds)
        self.file.write_text(str(os.getpid()))


@pytest.mark.parametrize("at_once", [1, 2])
def test_jobs_that_are_done_are_not_done_again(tmp_path, at_once, capsys):
    notes = [Note(tmp_path / f"{number}.txt") for number in range(3)]
    notes[1].file.write_text("earlier")
    with Board(3.0, own_bars=at_once == 1) as board:
        work(notes, at_once, board)
    assert notes[1].file.read_text() == "earlier"
    here = {job.file.read_text() for job in (notes[0], notes[2])} == {str(os.getpid())}
    assert here == (at_once == 1)
    assert "done: 2" in capsys.readouterr().err


@pytest.mark.parametrize("pace", [0.5, 1.0, 4.0])
def test_the_time_left_is_true_to_a_factor_of_two_after_the_first_tenth(pace, monkeypatch, capsys):
    known = {}

    def job(name, weight, *, on_all_cores=False):
        told = SimpleNamespace(name=name, weight=weight, on_all_cores=on_all_cores, done=False)
        told.progress = lambda: (known.get(name, 0.0), str(known.get(name)))
        return told

    rounds = [[job("record", 5.0)] * 2, [job("identify", 40.0, on_all_cores=True)]]
    rounds += [[job("train", 190.0)] * 2, [job("hop", 8.0)] * 2]
    total = 100.0 + sum(one.weight for stage in rounds for one in stage)
    now, since, whole = 0.0, {}, pace * total / 2
    monkeypatch.setattr(time, "monotonic", lambda: now)
    monkeypatch.setattr("hopping_leg.progress._LINE_SECONDS", 0.0)
    board = Board(total, at_once=2)
    for stage in rounds:
        begin, taken = now, pace * sum(one.weight for one in stage) / 2
        while now < begin + taken:
            known["train"] = (now - begin) / taken // 0.2 * 0.2  # its snapshots tell
            jobs._show(stage, since, board)
            left = capsys.readouterr().err.rpartition("about ")[2].split()[0].split(":")
            if 0.1 * whole < now < 0.95 * whole:
                assert 0.5 < (60 * int(left[0]) + int(left[1])) / (whole - now) < 2.0
            now += 1.0
        for one in stage:
            board.finish(one.name, one.weight)
