import json
import re

import pytest

from hopping_leg.cli import main
from hopping_leg.trace import Trace


def test_one_folder_receives_numbers_report_and_traces(spring, tmp_path, capsys, refused):
    out = tmp_path / "run"
    words = ["evaluate", "spring", "--commands", "0.3", "--seeds", "1", "--no-video"]
    assert main([*words, "--threads", "1", "--out", str(out)]) == 0
    data = json.loads((out / "evaluation.json").read_text())
    assert [row["command_m"] for row in data["summary"]] == [0.3]
    assert data["command"].startswith("hop evaluate spring --commands 0.3 --seeds 1")
    assert data["secondary"]["conditions"]["floor"] == "stiff"
    assert b"hop evaluate spring --commands 0.3 --seeds 1" in (out / "report.html").read_bytes()
    traces = sorted((out / "traces").iterdir())
    assert [path.name for path in traces] == [
        "spring-fixed-0.300-0.parquet",
        "spring-ladder-0.300-0.parquet",
    ]
    assert Trace.load(traces[0]).header["controller"] == "spring"
    assert "spring" in capsys.readouterr().out
    page = tmp_path / "again.html"
    assert main(["report", "page", str(out), "--out", str(page)]) == 0
    again, report = (path.read_text() for path in (page, out / "report.html"))
    assert re.sub('data:[^"]*', "", again) == re.sub('data:[^"]*', "", report)
    figures = tmp_path / "figures"
    words = ["report", "figures", "--out", str(figures)]
    assert main([*words, "--format", "png", *map(str, traces)]) == 0
    assert {"heights.png", "ladder.png"} <= {path.name for path in figures.iterdir()}
    refused([*words, "--animation", "gif", traces[1]], "No trace of spring holds one command")


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--commands", "0.5"], "trained for 0.29 to 0.31 m"),
        (["--commands", "9"], "out of reach"),
        (["--commands", "high"], "not a list of heights"),
        (["--seeds", "0"], "0 seeds are too few"),
        (["--seed", "-1"], "--seed is -1"),
        (["--robot", "legv9"], "There is no robot 'legv9'"),
        (["--threads", "-1"], "'threads' is -1"),
        (["--timestep", "nan"], "'timestep' is nan"),
        (["--rate", "0"], "'rate' is 0"),
        (["--json", "/dev/null/x/result.json"], "/dev/null"),
        (["--json", "/"], "is a folder"),
        (["--timestep", "0.003"], "does not divide"),
    ],
)
def test_bad_input_is_one_sentence(spring, refused, words, sentence):
    refused(["evaluate", "spring", *words], sentence)
