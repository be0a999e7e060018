"""Each change on the page is carried out as it stands there, in a copy if it is the package's."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import hopping_leg

pytest.importorskip("torch")

ROOT = Path(__file__).parent.parent
PAGE = (ROOT / "docs" / "how-to-change-it.md").read_text(encoding="utf-8")
CHANGES = re.findall(r"^## (.*?)\n(.*?)(?=^## |\Z)", PAGE, re.DOTALL | re.MULTILINE)
BLOCK = re.compile(r'^```(?:python|toml) title="(.*?)"\n(.*?)^```$', re.DOTALL | re.MULTILINE)
COMMAND = re.compile(r"^```sh\n(.*?)^```$", re.DOTALL | re.MULTILINE)

SHORT = {
    "train": "--steps 512 --set num_envs=8 n_steps=32 batch_size=64 log_every=1",
    "evaluate": "--commands 0.3 --seeds 1 --floor soft --no-video",
    "robustness": "--commands 0.3 --seeds 1",
}
"""What makes a verb's command short."""

SAYS = {
    "A fault": "slow_warming",
    "A robot": "my-robot",
    "A robustness axis": "joint-damping",
    "A recipe": "long",
}
"""What the commands of a change print, where that shows it."""


def carry_out(title, text, source):
    """Write a block to its file, or to the end of a file of the package."""
    file, _, place = title.partition(" ")
    assert place in ("", "at the end")
    path = source / Path(file).relative_to("src/hopping_leg") if place else Path(file)
    code = path.read_text(encoding="utf-8") + "\n\n" if place else ""
    path.write_text(code + text, encoding="utf-8")


@pytest.mark.slow
@pytest.mark.parametrize(("name", "section"), CHANGES, ids=[name for name, _ in CHANGES])
def test_the_change_works_as_the_page_says(name, section, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    blocks = BLOCK.findall(section)
    assert blocks
    package = Path(hopping_leg.__file__).parent
    if any(title.startswith("src/") for title, _ in blocks):  # a copy compiles its physics anew
        package = shutil.copytree(package, tmp_path / "package" / "hopping_leg")
    for title, text in blocks:
        carry_out(title, text, package)
    said = ""
    for command in "".join(COMMAND.findall(section)).splitlines():
        hop, verb, *words = command.split()
        assert hop == "hop"
        done = subprocess.run(
            [sys.executable, "-m", "hopping_leg.cli", verb, *words, *SHORT.get(verb, "").split()],
            env={**os.environ, "PYTHONPATH": str(package.parent)},
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, f"{command}\n{done.stdout[-2000:]}{done.stderr[-2000:]}"
        said += done.stdout + done.stderr
    assert SAYS.get(name, "") in said


def test_the_page_has_all_seven_changes():
    assert len(CHANGES) == 7
    assert SAYS.keys() <= dict(CHANGES).keys()
