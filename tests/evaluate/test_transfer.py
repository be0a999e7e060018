"""The sim-to-real experiment: what is asked for is done once, and the tables say what came out."""

import dataclasses
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from hopping_leg.errors import RobotError, UsageError
from hopping_leg.evaluate.transfer import fitting, hopping, tables
from hopping_leg.evaluate.transfer.board import Board
from hopping_leg.evaluate.transfer.effects import EFFECTS, HopWithout
from hopping_leg.evaluate.transfer.hopping import Hop
from hopping_leg.evaluate.transfer.methods import METHODS, choose_methods
from hopping_leg.evaluate.transfer.ratio import compare
from hopping_leg.evaluate.transfer.recording import Record
from hopping_leg.evaluate.transfer.study import Study, TwinFile, find_twins
from hopping_leg.evaluate.transfer.training import Train
from hopping_leg.evaluate.transfer.work import work
from hopping_leg.identify.candidate import Candidate
from hopping_leg.identify.pipeline import IdentifyOptions, identify
from hopping_leg.identify.recording import load_recording
from hopping_leg.robot import load_robot
from hopping_leg.sim import NOTHING
from hopping_leg.sim.twins import IDENTIFIABLE
from hopping_leg.trace import Trace
from tests.identify.twin import record, swing

LEG = Candidate(load_robot("legv2"))


def study(folder, methods=("identified", "cad"), **options):
    twins = find_twins(["2"], folder / "twins")
    return Study(folder, twins, tuple(choose_methods(methods)), **options)


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


def test_no_method_trains_on_what_the_twin_alone_knows(tmp_path):
    one = study(tmp_path, ("cad", "table-1", "randomised", "truth"))
    twin = one.twins[0]
    cad, paper, mixed, truth = (Train(one, twin, method, 0) for method in one.methods)
    assert cad.robot == mixed.robot == load_robot("legv2")
    assert paper.robot == load_robot("legv2-paper")
    assert mixed._recipe().task.randomised == IDENTIFIABLE
    assert truth.robot.reality.only_delays
    assert truth.robot.rail == twin.robot.rail
    assert truth.robot.reality.latency.command == twin.robot.reality.latency.command


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


def trials(errors, commands=(0.25, 0.35), **more):
    """Return trial rows from errors[method][twin][command]."""
    return [
        {
            "method": method, "twin": twin, "seed": 0, "command_m": command,
            "median_error_m": float(error), "median_abs_error_m": abs(float(error)),
            "std_m": 0.001, "hops": 10, "skipped_hops": 1, "body_contacts": 0,
            "motionless": False, **more,
        }
        for method, twins in errors.items()
        for twin, of_commands in twins.items()
        for command, error in zip(commands, of_commands, strict=True)
    ]  # fmt: skip


ERRORS = {
    "identified": {"a": (0.01, -0.02), "b": (0.02, 0.03), "c": (0.03, 0.04)},
    "cad": {"a": (0.03, -0.06), "b": (0.06, 0.09), "c": (-0.09, -0.12)},
}


def test_rows_are_medians_over_twins_with_intervals_around_them():
    rows = [r for r in trials(ERRORS) if r["method"] == "identified" and r["command_m"] == 0.35]
    row = tables._pooled(METHODS["identified"], rows)
    assert row["median_abs_error_m"] == pytest.approx(0.03)
    assert row["median_error_m"] == pytest.approx(0.03)
    assert row["worst_abs_error_m"] == pytest.approx(0.04)
    assert 0.02 <= row["median_abs_error_low_m"] < 0.03 < row["median_abs_error_high_m"] <= 0.04
    assert (row["hops"], row["skipped_hops"], row["policies"]) == (30, 3, 3)


def test_the_ratio_meets_the_same_twins():
    found = compare("identified", "cad", trials(ERRORS), 0)
    assert found["ratio"] == pytest.approx(3.0)
    assert found["ratio_low"] == pytest.approx(3.0)
    assert found["ratio_high"] == pytest.approx(3.0)
    assert found["least_ratio_of_a_command"] == pytest.approx(3.0)


def test_order_is_of_the_apexes_and_a_leg_that_stands_has_none(tmp_path):
    one = study(tmp_path, ("identified",), commands=(0.25, 0.35))
    method = one.methods[0]
    rows = trials({"identified": {"a": (0.0, -0.099), "b": (0.06, -0.05), "c": (0.0, 0.0)}})
    assert tables._whole(method, rows, one)["ordered"] == 2
    for row in rows[-2:]:
        row["motionless"] = True
    assert tables._whole(method, rows, one)["ordered"] == 1


@pytest.mark.parametrize("effect", EFFECTS)
def test_one_effect_is_taken_away_and_the_rest_stays(tmp_path, effect):
    one = study(tmp_path, ("identified",))
    twin, method = one.twins[0], one.methods[0]
    whole, less = Hop(one, twin, method, 0), HopWithout(one, twin, method, 0, effect)
    assert less.leg != whole.leg == twin.robot
    assert not less.leg.reality.only_delays
    assert less._file != whole._file
    for other in set(EFFECTS) - {effect}:
        assert EFFECTS[other](less.leg.reality) != less.leg.reality
    assert EFFECTS[effect](less.leg.reality) == less.leg.reality


def test_without_all_effects_nothing_is_left(tmp_path):
    reality = study(tmp_path).twins[0].robot.reality
    for take_away in EFFECTS.values():
        reality = take_away(reality)
    periods = reality.hip.ripple_periods, reality.knee.ripple_periods
    assert dataclasses.replace(
        reality,
        hip=dataclasses.replace(reality.hip, ripple_periods=1.0),
        knee=dataclasses.replace(reality.knee, ripple_periods=1.0),
    ).neutral
    assert periods != (1.0, 1.0)


def test_a_twin_is_met_with_its_own_effects_alone():
    assert hopping.disturbance_of(load_robot("twin")) == NOTHING
    assert hopping.disturbance_of(load_robot("legv2")).torque_noise > 0


@dataclasses.dataclass(frozen=True)
class Note:
    """A job that writes down which process did it."""

    file: Path
    seconds: float = 0.0
    weight = 1.0

    @property
    def name(self):
        return self.file.stem

    @property
    def done(self):
        return self.file.exists()

    def run(self, *, quiet):
        time.sleep(self.seconds)
        self.file.write_text(str(os.getpid()))

    def progress(self):
        return ""


@pytest.mark.parametrize("at_once", [1, 2])
def test_jobs_that_are_done_are_not_done_again(tmp_path, at_once, capsys):
    jobs = [Note(tmp_path / f"{number}.txt") for number in range(3)]
    jobs[1].file.write_text("earlier")
    with Board(3.0, own_bars=at_once == 1) as board:
        work(jobs, at_once, board)
    assert jobs[1].file.read_text() == "earlier"
    here = {job.file.read_text() for job in (jobs[0], jobs[2])} == {str(os.getpid())}
    assert here == (at_once == 1)
    assert "done: 2" in capsys.readouterr().err


_KILLED = """
import sys
from pathlib import Path
from hopping_leg.evaluate.transfer.board import Board
from hopping_leg.evaluate.transfer.work import work
from tests.evaluate.test_transfer import Note
if __name__ == "__main__":
    with Board(2.0) as board:
        work([Note(Path(sys.argv[1]) / f"{n}.txt", 20.0) for n in range(2)], 2, board)
"""


@pytest.mark.slow
def test_no_job_outlives_a_killed_study(tmp_path):
    script = tmp_path / "study.py"
    script.write_text(_KILLED)
    process = subprocess.Popen(
        [sys.executable, str(script), str(tmp_path)],
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])},
        stderr=subprocess.DEVNULL,
    )
    time.sleep(15)
    children = [
        int(entry.name)
        for entry in Path("/proc").iterdir()
        if entry.name.isdigit()
        and (entry / "stat").exists()
        and (entry / "stat").read_text().rsplit(")", 1)[1].split()[1] == str(process.pid)
    ]
    assert len(children) >= 2
    process.send_signal(signal.SIGKILL)
    process.wait()
    time.sleep(8)
    assert not [child for child in children if Path(f"/proc/{child}/cmdline").exists()]
    assert not list(tmp_path.glob("*.txt"))


def test_a_leg_that_never_hops_errs_by_the_command(tmp_path, monkeypatch):
    rows = [dict.fromkeys(hopping._KEPT, 0.0) | {"command_m": 0.3, "median_error_m": None}]

    class Judged:
        distributions = ({"command_m": 0.3, "apexes_m": []},)

        def to_json(self):
            return {"summary": rows}

    (row,) = hopping._rows(Judged())
    assert row["motionless"]
    assert (row["median_error_m"], row["median_abs_error_m"]) == (-0.3, 0.3)
    assert json.dumps(row)
    assert np.isfinite(row["median_abs_error_m"])


def test_a_twin_file_knows_who_it_is():
    twin = TwinFile("twin", "twin", "legv2-paper")
    assert twin.robot == load_robot("twin")
    assert twin.without_surprises.reality.only_delays
    assert twin.without_surprises.hip == load_robot("legv2-paper").hip


@pytest.fixture(scope="module")
def identified():
    run = record(LEG.replace({"hip.friction": 0.12}).robot, swing(8.0))
    options = IdentifyOptions(parameters=("hip.friction", "knee.friction"), threads=1)
    found = identify([run], LEG.robot, options=options)
    return dataclasses.replace(found, candidate=found.candidate.replace({"drive.delay": 0.003}))


def test_a_delay_that_was_found_is_one_that_training_has(identified, tmp_path):
    file = tmp_path / "found.toml"
    file.write_text(fitting.robot_file(identified, "legv2", file))
    robot = load_robot(file)
    assert robot.reality.latency.command == pytest.approx(0.003)
    assert robot.reality.only_delays
    assert robot.hip.friction == pytest.approx(0.12, rel=0.02)
    assert robot.rail == LEG.robot.rail


def test_a_fit_belongs_to_its_recordings(identified, tmp_path, monkeypatch):
    asked = []

    def fake(recordings, robot, **options):
        asked.append((recordings, robot.name))
        return identified

    monkeypatch.setattr(fitting, "identify", fake)
    one = study(tmp_path, ("fixed-base-only",))
    job = fitting.Identify(one, one.twins[0], one.methods[0])
    assert not job.done
    file = one.recording(one.twins[0], "fixed-base")
    record(LEG.robot, swing(2.0)).save(file)
    job.run(quiet=True)
    [(recordings, believed)] = asked
    assert believed == "legv2"
    assert [r.digest for r in recordings] == [load_recording(file).digest]
    assert job.done
    row = tables._fit(job)
    truth = {p["name"]: p["truth"] for p in row["parameters"]}
    assert truth["hip.friction"] == one.twins[0].robot.hip.friction
    record(LEG.robot, swing(3.0)).save(file)
    with pytest.raises(UsageError, match="other recordings"):
        assert job.done


def test_a_recording_belongs_to_its_twin_and_time(tmp_path):
    one = study(tmp_path)
    job = Record(one, one.twins[0], "rail")
    header = {"robot_digest": one.twins[0].robot.digest, "seconds": 60.0}
    Trace(pl.DataFrame({"time_s": [0.0]}), header).save(job._file)
    assert job.done
    longer = dataclasses.replace(job, study=dataclasses.replace(one, seconds=90.0))
    stranger = dataclasses.replace(job, twin=one.twins[1])
    stranger._file.write_bytes(job._file.read_bytes())
    for other in (longer, stranger):
        with pytest.raises(UsageError, match="another twin or for another time"):
            assert other.done
