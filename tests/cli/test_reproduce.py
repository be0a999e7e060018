"""`hop reproduce`: the whole chain, which goes on where it was killed."""

import html
import json
import re
import subprocess
import sys
import time

import pytest

from hopping_leg.cli import main
from hopping_leg.cli.reproduce import NOTHING_MEANT

pytest.importorskip("torch")


def test_a_folder_never_mixes_options(tmp_path, refused, monkeypatch):
    monkeypatch.setattr("hopping_leg.cli.reproduce._record", lambda *_: 1 / 0)
    words = ["reproduce", "--out", str(tmp_path)]
    with pytest.raises(ZeroDivisionError):
        main([*words, "--quick"])
    refused([*words], "give another --out")
    refused([*words, "--quick", "--seed", "1"], "give another --out")


@pytest.mark.slow
def test_a_killed_quick_run_goes_on_and_says_that_its_numbers_mean_nothing(tmp_path):
    command = [sys.executable, "-m", "hopping_leg.cli", "reproduce", "--quick"]
    quiet = subprocess.DEVNULL
    process = subprocess.Popen(command, cwd=tmp_path, stdout=quiet, stderr=quiet)
    folder = tmp_path / "runs" / "quick"
    deadline = time.monotonic() + 240
    while not (folder / "identified.toml").exists() and time.monotonic() < deadline:
        time.sleep(0.2)
    process.kill()
    process.wait()
    kept = {path: path.stat().st_mtime_ns for path in folder.glob("recordings/*.parquet")}
    assert len(kept) == 2
    assert not (folder / "report.html").exists()
    again = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=900)
    assert again.returncode == 0, again.stderr
    meant, hops, wins, *rest = again.stdout.splitlines()
    assert meant == NOTHING_MEANT
    assert "On the twin hop, of 6 heights: " in hops
    assert re.search(r"median \|apex - command\| .* \[[\d.]+, [\d.]+\]", wins)
    assert len(rest) < 10
    assert "nan" not in again.stdout
    assert {path: path.stat().st_mtime_ns for path in kept} == kept
    files = [folder / f"{part}evaluation.json" for part in ("simulation/", "")]
    evaluation, transfer = (json.loads(file.read_text()) for file in files)
    assert {row["controller"] for row in evaluation["summary"]} >= {"energy-shaping"}
    met = {row["controller"] for row in transfer["summary"]}
    assert met == {"identified", "cad", "energy-shaping-tuned"}
    assert evaluation["notes"][0] == transfer["notes"][0] == NOTHING_MEANT
    page = (folder / "report.html").read_text()
    assert page.index(html.escape(hops)) < page.index(html.escape(wins)) < page.index("<figure>")
