from pathlib import Path

from hopping_leg.cli import main
from tests.doc_pages import ROOT

LEG = str(ROOT / "examples/leg.urdf")


def test_an_imported_leg_is_checked_and_what_was_assumed_is_listed(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    words = ["robots", "import", LEG, "--motor", "ak80-9", "ak80-6", "--set", "knee.belt_ratio=1.5"]
    assert main([*words, "--out", "a leg.toml"]) == 0
    said = capsys.readouterr().out
    assert "hip = -hip_pitch" in said
    assert said.count("rail.friction") == 1
    assert "knee.belt_ratio" not in said
    assert main(["robots", "check", "a leg.toml"]) == 0
    assert "valid robot: heron" in capsys.readouterr().out
    assert "assumed: unknown until identified" in Path("a leg.toml").read_text()
