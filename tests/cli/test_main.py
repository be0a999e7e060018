import errno
import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from types import SimpleNamespace

import pytest
import tyro
from hypothesis import given
from hypothesis import strategies as st

from hopping_leg import cli
from hopping_leg.cli import main
from hopping_leg.cli.options import Heights
from hopping_leg.errors import UsageError
from hopping_leg.robot import load_robot, load_tree, numbers, shipped_robots


@dataclass(frozen=True)
class Nothing:
    depth: int = 1


def failing(monkeypatch, error):
    """Make `hop robots` raise."""

    def run(args: Nothing) -> None:
        raise error

    monkeypatch.setattr(cli.importlib, "import_module", lambda _: SimpleNamespace(run=run))
    return main(["robots"])


def test_version_and_overview_are_said(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.startswith("hop 0.")
    assert main([]) == 0
    shown = capsys.readouterr().out
    assert all(f" {verb} " in shown for verb in cli.VERBS)


def test_help_loads_nothing_heavy():
    heavy = {"numba", "scipy", "matplotlib", "torch", "onnxruntime"}
    code = "import sys, hopping_leg.cli as c; c.main([]); early = 'mujoco' in sys.modules;"
    code += "".join(f"import hopping_leg.cli.{verb};" for verb in cli.VERBS if verb != "demo")
    code += f"sys.exit(early or bool({heavy} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True).returncode == 0


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["robot"], "Did you mean 'robots'?"),
        (["robots", "show", "legv3"], "There is no robot 'legv3'."),
        (["export", "policy", "LICENSE"], "not a policy file"),
        (["export", "urdf", "--out", "/dev/full"], "No space left on device"),
    ],
)
def test_bad_input_is_one_sentence_and_exit_code_2(capsys, arguments, sentence):
    assert main(arguments) == 2
    captured = capsys.readouterr()
    assert sentence in captured.err
    assert captured.err.startswith("hop: ")
    assert captured.err.count("\n") == 1


@pytest.mark.parametrize(
    ("error", "code", "sentence"),
    [
        (UsageError("Too high; 0.4 m was valid."), 2, "hop: Too high; 0.4 m was valid.\n"),
        (KeyboardInterrupt(), 130, "Interrupted"),
        (PermissionError(errno.EACCES, "Permission denied", "x.json"), 2, "x.json: Permission"),
        (ModuleNotFoundError("no torch", name="torch"), 2, "hopping-leg[train]"),
    ],
)
def test_errors_become_sentences(monkeypatch, capsys, error, code, sentence):
    assert failing(monkeypatch, error) == code
    assert sentence in capsys.readouterr().err


def test_a_bug_keeps_its_traceback(monkeypatch):
    with pytest.raises(ZeroDivisionError):
        failing(monkeypatch, ZeroDivisionError())
    with pytest.raises(ModuleNotFoundError):
        failing(monkeypatch, ModuleNotFoundError("no such thing", name="hopping_leg.nothing"))


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["evaluat"], "Did you mean 'evaluate'?"),
        (["train", "--sed", "3"], "--seed"),
        (["deploy", "fast"], "--transport"),
        (["robots", "check", "examples/my_log.toml"], "Or give a .toml file"),
        (["evaluate", "leg.urdf"], "make a robot file of it: hop robots import leg.urdf."),
    ],
)
def test_wrong_usage_is_said(refused, words, sentence):
    refused(words, sentence)


@dataclass(frozen=True)
class Lists:
    names: tyro.conf.Positional[tuple[str, ...]]
    heights: Heights = ()
    pair: tuple[float, float] | None = None
    set: tuple[str, ...] = ()


@pytest.mark.parametrize("given_as", [("0.2,0.3",), ("0.2", "0.3")])
def test_numbers_are_given_with_commas_or_spaces(given_as):
    words = ["run/x,y", "--heights", *given_as, "--pair", *given_as, "--set", "hip.friction=0,1"]
    found = cli.read_options(Lists, "hop", None, words)
    assert found == Lists(("run/x,y",), (0.2, 0.3), (0.2, 0.3), ("hip.friction=0,1",))


@pytest.mark.parametrize("verb", cli.VERBS)
def test_every_verb_has_help(capsys, verb):
    with pytest.raises(SystemExit, match="0"):
        main([verb, "--help"])
    shown = capsys.readouterr().out
    assert shown.startswith(f"usage: hop {verb}")
    assert "Examples:" in shown


def test_list_names_every_shipped_robot(capsys):
    assert main(["robots", "list"]) == 0
    shown = capsys.readouterr().out
    assert all(name in shown for name in shipped_robots())


@pytest.mark.parametrize("name", shipped_robots())
def test_show_gives_every_number_with_unit_and_source(capsys, name):
    assert main(["robots", "show", name]) == 0
    shown = capsys.readouterr().out
    entries = numbers(load_tree(name))
    assert len(entries) > 30
    for path, entry in entries:
        line = next(line for line in shown.splitlines() if f" {path} " in line)
        assert f"{entry['value']:g}" in line
        assert entry["source"] in line
    assert load_robot(name).digest in shown


def test_check_accepts_the_example(capsys):
    assert main(["robots", "check", "examples/my_leg.toml"]) == 0
    assert "valid robot: my-leg" in capsys.readouterr().out


def test_urdf_is_written_to_a_file_or_printed(tmp_path, capsys):
    file = tmp_path / "leg.urdf"
    assert main(["export", "urdf", "--out", str(file)]) == main(["export", "urdf"]) == 0
    assert file.read_text().startswith("<?xml")
    assert file.read_text() in capsys.readouterr().out


def hop(words, folder, **environment):
    """Run `hop` in a process of its own, in a folder that is its temporary one, too."""
    return subprocess.run(
        [sys.executable, "-m", "hopping_leg.cli", *words],
        capture_output=True,
        cwd=folder,
        env={**os.environ, "TMPDIR": str(folder), **environment},
    )


def test_what_a_terminal_cannot_encode_is_replaced(tmp_path):
    folder = tmp_path / "\u03c4"
    folder.mkdir()
    words = ["export", "policy", "fast", "--out", str(folder / "fast.onnx")]
    done = hop(words, tmp_path, PYTHONIOENCODING="ascii")
    assert done.returncode == 0, done.stderr
    assert f"Wrote {tmp_path}/?/fast.onnx" in done.stdout.decode("ascii")
    assert sorted(path.name for path in tmp_path.iterdir()) == [folder.name], "onnxruntime, mujoco"


def test_mujoco_writes_no_log_into_the_users_folder(tmp_path):
    code = (
        "import mujoco; from hopping_leg.robot import build_model, load_robot;"
        "model = build_model(load_robot('legv2')); data = mujoco.MjData(model);"
        "data.qacc[:] = data.qvel[:] = float('nan'); mujoco.mj_step(model, data)"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True)
    assert b"Nan" in done.stderr
    assert not list(tmp_path.iterdir())


def test_sigterm_ends_a_verb_as_ctrl_c_does(monkeypatch):
    def run(args: Nothing) -> None:
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(10)

    monkeypatch.setattr(cli.importlib, "import_module", lambda _: SimpleNamespace(run=run))
    assert main(["robots"]) == cli.INTERRUPTED


@given(st.text() | st.binary().map(lambda data: data.decode(errors="surrogateescape")))
def test_an_error_is_one_printable_line_whatever_is_in_it(text):
    said = str(UsageError(f"'{text * 50}' is wrong."))
    assert said.isprintable()
    assert len(said) < 1300
