"""What is handed out is whole: source archive, metadata, citation."""

import importlib.metadata
import json
import subprocess
import sys
import tarfile
import tomllib
from pathlib import Path

import pytest

import hopping_leg
from hopping_leg.cli import read_options
from hopping_leg.cli.view import View
from tests.doc_pages import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
LARGEST = 1_000_000


@pytest.mark.slow
def test_the_source_archive_holds_what_is_installed_and_read_nothing_large_and_no_run(tmp_path):
    command = [sys.executable, "-m", "build", "--sdist", "--no-isolation"]
    done = subprocess.run([*command, "--outdir", tmp_path, ROOT], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    (file,) = tmp_path.iterdir()
    with tarfile.open(file) as content:
        archive = {m.name.partition("/")[2]: m.size for m in content.getmembers() if m.isfile()}
    package = Path(hopping_leg.__file__).parent
    files = [path.relative_to(package) for path in package.rglob("*") if path.is_file()]
    inside = {f"src/hopping_leg/{path}" for path in files if "__pycache__" not in path.parts}
    assert {Path(name).suffix for name in inside} >= {".py", ".toml", ".xml", ".onnx", ".j2"}
    assert "src/hopping_leg/py.typed" in inside
    read = {"README.md", "CITATION.cff", "CHANGELOG.md", "constraints.txt", "Makefile"}
    read |= set(PROJECT["license-files"])
    read |= {str(path.relative_to(ROOT)) for path in (ROOT / "studies").rglob("*.py")}
    examples = {f"examples/{path.name}" for path in (ROOT / "examples").glob("*.*")}
    assert not (inside | read | examples) - set(archive)
    assert not {name: size for name, size in archive.items() if size > LARGEST}
    left = {"runs", "build", "site", ".venv", "MUJOCO_LOG.TXT"}
    assert not left & {name.partition("/")[0] for name in archive}


def test_the_container_is_built_by_the_commands_of_the_readme():
    lines = (ROOT / "Dockerfile").read_text().replace("\\\n", "").splitlines()
    commands = [line.removeprefix("RUN ") for line in lines if line.startswith("RUN ")]
    system, command = commands
    assert {"python3.11-venv", "make", "git"} <= set(system.split())
    assert command in (ROOT / "README.md").read_text()
    (call,) = [json.loads(line.removeprefix("CMD ")) for line in lines if line.startswith("CMD ")]
    assert not read_options(View, "hop demo", None, call[1:]).browser


def test_metadata_pages_and_what_tries_the_wheel_name_the_same_pythons():
    words = [text.split(" :: ") for text in PROJECT["classifiers"]]
    first, *others, last = names = [name for *_, language, name in words if language == "Python"]
    assert PROJECT["requires-python"] == f">={first}"
    commands = " ".join(f"python{name}" for name in names)
    said = {"README.md": f"Python {first} to {last} ", "Makefile": commands}
    said[".ci/wheel.sh"] = f" {commands}; do"
    said["docs/index.md"] = f"Python {', '.join([first, *others])} and {last}"
    assert [file for file, text in said.items() if text not in (ROOT / file).read_text()] == []


def test_the_installed_version_is_that_of_project_changelog_and_citation_and_pins_no_other():
    assert "==" not in f"{PROJECT}".replace(" == ", " is "), "beside it; markers have spaces"
    assert importlib.metadata.version("hopping-leg") == PROJECT["version"]
    assert f"## {PROJECT['version']}" in (ROOT / "CHANGELOG.md").read_text()
    yaml = pytest.importorskip("yaml", reason="PyYAML is not installed")
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert citation["version"] == PROJECT["version"]
    assert citation["license"] == PROJECT["license"]
    assert citation["preferred-citation"]["doi"] in (ROOT / "README.md").read_text()
