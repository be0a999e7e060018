"""`hop identify` as it is called: from files to files."""

import json
import re
from pathlib import Path

import polars as pl
import pytest

from hopping_leg.cli import FAILED, main
from hopping_leg.identify.result import save_robot
from hopping_leg.robot import load_robot
from tests.cli.emulated import put_behind
from tests.identify.fitting import TRUTH, TWIN, identified, run
from tests.identify.runs import SIDECAR, write_run
from tests.identify.twin import hops

FEW = ["--parameters", ",".join(TRUTH), "--search", "cma", "--population", "4"]


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """Return two recordings of the twin, as `hop record` makes them."""
    folder = tmp_path_factory.mktemp("recordings")
    files = [folder / "first.parquet", folder / "second.parquet"]
    for seconds, file in zip((6.0, 5.0), files, strict=True):
        hops(TWIN, seconds, "fixed-base").save(file)
    return files


def call(folder, *words):
    """Call the verb; return its exit code."""
    return main(["identify", *map(str, (*words, "--out", folder / "leg.toml"))])


def test_from_recordings_to_robot_numbers_and_report(recordings, tmp_path, capsys):
    fitted, judge = recordings
    out, numbers, page = (tmp_path / name for name in ("leg.toml", "leg.json", "leg.html"))
    words = [fitted, "--validate", judge, "--json", numbers, "--report", page]
    assert call(tmp_path, *words, "--parameters", ",".join(TRUTH)) == 0
    shown = capsys.readouterr().out
    assert all(str(path) in re.sub(r"\n", "", shown) for path in (out, numbers, page))
    assert "hip.friction" in shown

    robot, tree = load_robot(out), json.loads(numbers.read_text())
    assert robot.hip.friction == pytest.approx(TRUTH["hip.friction"], rel=0.02)
    assert tree["robot_digest"] == robot.digest
    before, after = tree["start_validation"], tree["validation"]
    assert max(after["closed_loop_position_rms_rad"]) < 1e-3
    assert after["open_loop_position_rms_rad"]["0.5"][0] < (
        0.2 * before["open_loop_position_rms_rad"]["0.5"][0]
    )
    assert tree["command"].startswith(f"hop identify {fitted} --validate {judge}")
    assert main(["robots", "check", str(out)]) == main(["robots", "show", str(out)]) == 0
    assert not re.search(r'(?:src|href)="(?!data:)', page.read_text())


def test_a_fit_that_is_worse_than_its_start_fails_and_every_file_says_so(
    recordings, tmp_path, capsys
):
    """Fitted to the leg itself, judged by another leg, from that other leg's numbers."""
    judge = tmp_path / "judge.parquet"
    hops(load_robot("legv2"), 6.0, "fixed-base").save(judge)
    words = [recordings[0], "--validate", judge, "--parameters", ",".join(TRUTH)]
    numbers, page = tmp_path / "leg.json", tmp_path / "leg.html"
    assert call(tmp_path, *words, "--json", numbers, "--report", page) == FAILED
    assert "do not use it" in json.loads(numbers.read_text())["warning"]
    assert "do not use it" in (tmp_path / "leg.toml").read_text().partition("\n")[0]
    text = page.read_text()
    assert text.index("do not use it") < text.index("How well it predicts")
    said = capsys.readouterr()
    assert said.out.index("do not use it") < said.out.index("95 % interval")
    assert "do not use it" in said.err


def test_a_run_on_an_emulated_leg_is_compared_with_what_was_predicted_of_it(
    recordings, tmp_path, monkeypatch, capsys, refused
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("hopping_leg.evaluate.trials.FIXED_SECONDS", 4.0)
    words = ["--parameters", ",".join(TRUTH), "--posterior", 20, "--json", "leg.json"]
    assert call(tmp_path, recordings[0], *words) == 0
    save_robot(identified(), Path("real.toml"), "legv2")
    put_behind(monkeypatch, robot="real.toml")
    predict = "evaluate energy-shaping --robot leg.toml --posterior leg.json --json predicted.json"
    deploy = "deploy energy-shaping --robot leg.toml --transport x --command 0.3 --seconds 4 --yes"
    assert main(predict.split()) == main(deploy.split()) == 0
    (trace,) = map(str, Path("runs/deploy").glob("*.parquet"))
    assert main(["report", trace, "--prediction", "predicted.json"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "Reality is within what was predicted: median_estimated_apex_m is in its" in said
    assert "Warning" not in said
    refused(["report", trace, "--prediction", "leg.json"], "has no predictions")
    refused(["evaluate", "fast", "--posterior", "leg.json"], "is not of legv2-identified")


def test_warnings_of_recordings_are_shown(tmp_path, capsys):
    table = run().trace.table.with_columns(
        hip_torque_nm=pl.Series([1e-40, *run().trace.table["hip_torque_nm"][1:]])
    )
    gains = "stiffness = [8.0, 8.0]\ndamping = [0.3, 0.3]\n"
    sidecar = SIDECAR.replace("200.0", "100.0") + 'onboard = "zoh"\n' + gains
    path = write_run(tmp_path, table, sidecar)
    assert call(tmp_path, path, *FEW, "--generations", "1") == 0
    assert "uninitialised memory" in capsys.readouterr().out
