import json

import pytest

from hopping_leg.cli import main

WORDS = ["robustness", "spring", "--commands", "0.3", "--seeds", "2"]
AXES = ["--axes", "pushes"]


def test_one_folder_receives_numbers_figure_and_what_goes_on(spring, tmp_path, capsys):
    out, file = tmp_path / "kept", tmp_path / "robustness.json"
    words = [*WORDS, *AXES, "--threads", "1", "--out", str(out)]
    assert main([*words, "--json", str(file)]) == 0
    data = json.loads(file.read_text())
    assert [row["axis"] for row in data["scores"]] == ["pushes", "overall"]
    assert all(0 <= row["low"] <= row["score"] <= row["high"] <= 1 for row in data["scores"])
    assert data["command"].startswith("hop robustness spring")
    assert "--axes pushes" in data["command"]
    assert (out / "robustness.svg").read_bytes().startswith(b"<?xml")
    assert "overall" in capsys.readouterr().out
    kept = {path.name: path.read_bytes() for path in out.glob("spring-*.json")}
    assert len(kept) == 2
    assert main(words) == 0
    assert json.loads((out / "robustness.json").read_text())["scores"] == data["scores"]
    assert {path.name: path.read_bytes() for path in out.glob("spring-*.json")} == kept


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ([*WORDS, "--axes", "wind"], "There is no axis 'wind'"),
        ([*WORDS[:2], "--commands", "0.25"], "trained for 0.29 to 0.31 m"),
    ],
)
def test_bad_input_is_one_sentence(spring, refused, tmp_path, monkeypatch, words, sentence):
    monkeypatch.chdir(tmp_path)
    refused(words, sentence)
