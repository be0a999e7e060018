"""The examples run, and the notebooks from top to bottom; those are stored as written."""

import runpy
import sys
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

from tests.rl.learners import try_briefly

EXAMPLES = Path(__file__).parent.parent / "examples"
NOTEBOOKS = pytest.mark.parametrize(
    "path", sorted((EXAMPLES / "notebooks").glob("*.ipynb")), ids=lambda p: p.stem
)
ARGUMENTS = {"train_your_own": ["16384"], "custom_reward": ["1024"], "tune": ["1", "1024"]}
"""What makes the long ones short."""


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.py")), ids=lambda p: p.stem)
def test_every_example_fits_a_screen_and_runs(path, tmp_path, monkeypatch, capsys):
    assert len(path.read_text().splitlines()) <= 60
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "agg")
    if path.stem in ARGUMENTS:
        try_briefly(monkeypatch)
    monkeypatch.setattr(sys, "argv", [str(path), *ARGUMENTS.get(path.stem, [])])
    runpy.run_path(str(path), run_name="__main__")
    assert capsys.readouterr().out
    if path.stem in ARGUMENTS:  # what is finished is not refused when it is run again
        monkeypatch.setattr("hopping_leg.rl.train.Trainer", None)
        runpy.run_path(str(path), run_name="__main__")
        assert "finished" in capsys.readouterr().out


@NOTEBOOKS
def test_nothing_that_a_run_left_is_stored(path):
    notebook = nbformat.read(path, as_version=4)
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert code
    assert all(not cell.outputs and cell.execution_count is None for cell in code)


@pytest.mark.slow
@NOTEBOOKS
def test_every_notebook_runs(path, tmp_path, monkeypatch):
    for name in ("JUPYTER_RUNTIME_DIR", "JUPYTER_CONFIG_DIR", "IPYTHONDIR"):
        monkeypatch.setenv(name, str(tmp_path / name))
    monkeypatch.delenv("MPLBACKEND", raising=False)
    notebook = nbformat.read(path, as_version=4)
    resources = {"metadata": {"path": str(tmp_path)}}
    NotebookClient(notebook, timeout=300, kernel_name="python3", resources=resources).execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    assert not [o for o in outputs if o.get("name") == "stderr"]
    shown = {kind for o in outputs for kind in o.get("data", {})}
    assert shown & {"image/png", "image/svg+xml"}
    assert "text/html" in shown
