from pathlib import Path

import pytest

from hopping_leg.cli import main
from tests.doc_pages import ROOT

LEG = str(ROOT / "examples/leg.urdf")


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_an_imported_leg_is_checked_and_what_was_assumed_is_listed(capsys):
    words = ["robots", "import", LEG, "--motor", "ak80-9", "ak80-6", "--set", "knee.belt_ratio=1.5"]
    assert main([*words, "--out", "a leg.toml"]) == 0
    said = capsys.readouterr().out
    assert "hip = -hip_pitch" in said
    listed = [line for line in said.splitlines() if "rail.friction" in line]
    assert len(listed) == 1
    assert "knee.belt_ratio" not in said
    assert main(["robots", "check", "a leg.toml"]) == 0
    assert "valid robot: heron" in capsys.readouterr().out
    assert "assumed: unknown until identified" in Path("a leg.toml").read_text()


def test_a_robot_file_is_not_replaced_and_a_description_is_no_robot(refused):
    Path("leg.toml").write_text("mine")
    refused(["robots", "import", LEG], "leg.toml exists and is not replaced")
    assert Path("leg.toml").read_text() == "mine"
    words = ["evaluate", "energy-shaping", "--robot", "a leg.urdf"]
    refused(words, "`hop robots import` makes one of a URDF")
