"""Each change on the page is carried out as it stands there, in a copy if it is the package's."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import hopping_leg
from tests.doc_pages import DOCS

pytest.importorskip("torch")
PAGE = (DOCS / "how-to-change-it.md").read_text(encoding="utf-8")
CHANGES = re.findall(r"^## (.*?)\n(.*?)(?=^## |\Z)", PAGE, re.DOTALL | re.MULTILINE)
BLOCK = re.compile(r'^```(?:python|toml) title="(.*?)"\n(.*?)^```$', re.DOTALL | re.MULTILINE)
COMMAND = re.compile(r"^```sh\n(.*?)^```$", re.DOTALL | re.MULTILINE)

SHORT = {
    "train": "--steps 512 --heights 0.28 0.32"
    " --set num_envs=8 batch_size=64 log_every=1 calibrations=1",
    "evaluate": "--commands 0.3 --seeds 1 --floor soft",
    "robustness": "--commands 0.3 --seeds 1",
}
"""What makes a verb's command short."""

SAYS = {
    "A fault": "slow_warming", "A robot": "my-robot", "A robustness axis": "joint-damping",
    "A recipe": "long",
}  # fmt: skip
"""What the commands of a change print, where that shows it."""


@pytest.fixture(scope="module")
def copied(tmp_path_factory):
    """A copy of the package, into which every change goes; it compiles its physics anew."""
    folder = tmp_path_factory.mktemp("package")
    shutil.copytree(Path(hopping_leg.__file__).parent, folder / "hopping_leg")
    return folder


@pytest.mark.slow
@pytest.mark.parametrize(("name", "section"), CHANGES, ids=[name for name, _ in CHANGES])
def test_the_change_works_as_the_page_says(name, section, tmp_path, monkeypatch, request):
    monkeypatch.chdir(tmp_path)
    blocks, source = BLOCK.findall(section), Path(hopping_leg.__file__).parents[1]
    assert blocks
    for title, text in blocks:
        file, _, place = title.partition(" ")
        assert place in ("", "at the end")
        if place:
            source = request.getfixturevalue("copied")
            file = source / Path(file).relative_to("src")
            text = f"{file.read_text(encoding='utf-8')}\n\n{text}"
        Path(file).write_text(text, encoding="utf-8")
    said = ""
    for command in "".join(COMMAND.findall(section)).splitlines():
        hop, verb, *words = command.split()
        assert hop == "hop"
        words += SHORT.get(verb, "").split()
        done = subprocess.run(
            [sys.executable, "-m", "hopping_leg.cli", verb, *words],
            env={**os.environ, "PYTHONPATH": str(source)},
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, f"{command}\n{done.stdout[-2000:]}{done.stderr[-2000:]}"
        said += done.stdout + done.stderr
    assert SAYS.get(name, "") in said


def test_the_page_has_all_seven_changes():
    assert len(CHANGES) == 7
    assert SAYS.keys() <= dict(CHANGES).keys()
