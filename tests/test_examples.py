import runpy
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parent.parent / "examples"
ARGUMENTS = {"train_your_own": ["16384"], "custom_reward": ["16384"]}
"""What makes the long ones short."""


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.py")), ids=lambda p: p.stem)
def test_every_example_runs(path, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "agg")
    if path.stem in ARGUMENTS:
        monkeypatch.setattr("hopping_leg.rl.policy_evaluation._SECONDS", 0.5)
    monkeypatch.setattr(sys, "argv", [str(path), *ARGUMENTS.get(path.stem, [])])
    runpy.run_path(str(path), run_name="__main__")
    assert capsys.readouterr().out
    if path.stem in ARGUMENTS:  # what is finished is not refused when it is run again
        monkeypatch.setattr("hopping_leg.rl.train.Trainer", None)
        runpy.run_path(str(path), run_name="__main__")
        assert "finished" in capsys.readouterr().out


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.py")), ids=lambda p: p.stem)
def test_every_example_fits_a_screen(path):
    assert len(path.read_text().splitlines()) <= 60
