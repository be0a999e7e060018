"""The rooms of the house: data flows one way, and the core needs no torch."""

import ast
import graphlib
from pathlib import Path

import pytest

import hopping_leg
from tests.extras import TRAINING, run_without

ROOT = Path(hopping_leg.__file__).parent
ORDER = ["foundation", "robot", "formats", "sim", "controllers", "identify", "envs", "rl"]
ORDER += ["deploy", "emulator", "evaluate", "viewer", "cli"]
FOUNDATION = {"", "arrays", "errors", "figures", "flight_recording", "hop_detection"}
FOUNDATION |= {"html_page", "io", "locks", "terminal", "trace", "workers"}
BESIDE = {("viewer", "rl"), ("viewer", "deploy"), ("viewer", "emulator"), ("emulator", "rl")}
BESIDE |= {("deploy", room) for room in ("formats", "sim", "identify", "envs", "rl")}
BESIDE |= {("evaluate", room) for room in ("identify", "envs", "rl", "deploy", "emulator")}
"""Later rooms that still must not use these earlier ones: neither evaluation, viewer nor robot
needs torch, what drives the robot knows no simulation, and only ``cli`` reaches into it."""

MODULES = sorted(ROOT.rglob("*.py"))


def dotted(path):
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(("hopping_leg", *parts)).removesuffix(".__init__")


def room(name):
    parts = name.split(".")
    name = parts[1] if len(parts) > 1 else ""
    return "foundation" if name in FOUNDATION else name


def imports(tree):
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "relative imports hide the room"
            yield node.module


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(ROOT)))
def test_no_room_imports_a_later_one_or_a_study_or_needs_posix_to_be_imported(path):
    relative, tree = path.relative_to(ROOT), ast.parse(path.read_text(encoding="utf-8"))
    here, top = room(dotted(path)), [n for n in tree.body if isinstance(n, ast.Import)]
    assert not {"fcntl", "termios", "tty"} & {*imports(ast.Module(top, []))}
    for name in imports(tree):
        if name.split(".")[0] == "hopping_leg":
            there = room(name)
            assert ORDER.index(there) <= ORDER.index(here), f"{relative} imports {name}"
            assert (here, there) not in BESIDE, f"{relative} imports {name}"
        elif name.split(".")[0] in TRAINING:
            assert here == "rl", f"{relative} imports {name}"
        assert name.split(".")[0] not in {"studies", "pickle", "dill", "cloudpickle", "joblib"}


def files_imported(path, names):
    """Yield the modules among ``names`` that a file imports; a submodule, not its package."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in names)
        elif isinstance(node, ast.ImportFrom):
            inner = {f"{node.module}.{alias.name}" for alias in node.names}
            yield from inner & names
            if not inner <= names and node.module in names:
                yield node.module


def test_no_files_import_each_other_in_a_circle():
    files = {dotted(path): path for path in MODULES}
    graph = {name: set(files_imported(path, files.keys())) for name, path in files.items()}
    graphlib.TopologicalSorter(graph).prepare()


def test_everything_but_learning_imports_without_the_training_extra():
    names = [dotted(path) for path in MODULES]
    names = [n for n in names if not n.endswith(".__main__") and room(n) != "rl"]
    code = f"import importlib\nfor name in {names}: importlib.import_module(name)"
    result = run_without(TRAINING, code)
    assert result.returncode == 0, result.stderr
