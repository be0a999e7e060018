import shlex
from pathlib import Path

import pytest

from hopping_leg.cli import main
from hopping_leg.robot import load_robot
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
    commands = said.partition("Next:\n")[2].splitlines()
    assert shlex.split(commands[0]) == ["hop", "robots", "check", "a leg.toml"]


def test_a_terminal_is_asked_for_what_the_file_does_not_say(capsys, monkeypatch):
    asked = []

    answers = iter(["qdd100", "two", "", "", "", "2"])

    def answer(question):
        asked.append(question)
        return next(answers)

    monkeypatch.setattr("builtins.input", answer)
    for stream in ("stdin", "stdout"):
        monkeypatch.setattr(f"sys.{stream}.isatty", lambda: True)
    assert main(["robots", "import", LEG]) == 0
    assert "'two' is no number; give one in N, or press Enter." in capsys.readouterr().out
    assert [question.partition(" ")[0] for question in asked] == [
        "Motor",
        "rail.friction,",
        "rail.friction,",
        "contact.time_constant,",
        "hip.belt_ratio,",
        "knee.belt_ratio,",
    ]
    assert load_robot("leg.toml").knee.belt_ratio == 2.0


def test_a_robot_file_is_not_replaced_and_a_description_is_no_robot(refused):
    Path("leg.toml").write_text("mine")
    refused(["robots", "import", LEG], "leg.toml exists and is not replaced")
    assert Path("leg.toml").read_text() == "mine"
    words = ["evaluate", "energy-shaping", "--robot", "a leg.urdf"]
    refused(words, "make one of it: hop robots import 'a leg.urdf'.")
