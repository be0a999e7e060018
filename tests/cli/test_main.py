import errno
import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from types import SimpleNamespace
from unittest.mock import Mock

import pytest
import tyro
from hypothesis import given
from hypothesis import strategies as st

from hopping_leg import cli
from hopping_leg.cli import FAILED, main
from hopping_leg.cli.options import Heights
from hopping_leg.errors import UsageError
from hopping_leg.robot import load_robot, load_tree, numbers, shipped_robots
from tests.doc_pages import ROOT


@dataclass(frozen=True)
class Nothing:
    depth: int = 1


def calling(monkeypatch, action):
    """Call `hop robots`, which does something else."""

    def run(args: Nothing) -> None:
        action()

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
    ("error", "code", "sentence"),
    [
        (UsageError("Too high; 0.4 m was valid."), 2, "hop: Too high; 0.4 m was valid.\n"),
        (KeyboardInterrupt(), 130, "Interrupted"),
        (PermissionError(errno.EACCES, "Permission denied", "x.json"), 2, "x.json: Permission"),
        (ModuleNotFoundError("no torch", name="torch"), 2, "hopping-leg[train]"),
    ],
)
def test_errors_become_sentences(monkeypatch, capsys, error, code, sentence):
    assert calling(monkeypatch, Mock(side_effect=error)) == code
    assert sentence in capsys.readouterr().err


def test_a_bug_keeps_its_traceback(monkeypatch):
    nothing = ModuleNotFoundError("no such thing", name="hopping_leg.nothing")
    for error in (ZeroDivisionError(), nothing):
        with pytest.raises(type(error)):
            calling(monkeypatch, Mock(side_effect=error))


@dataclass(frozen=True)
class Lists:
    names: tyro.conf.Positional[tuple[str, ...]]
    heights: Heights = ()
    pair: tuple[float, float] | None = None
    set: tuple[str, ...] = ()


@pytest.mark.parametrize("given_as", [("0.2,0.3",), ("0.2", "0.3")])
def test_numbers_are_given_with_commas_or_spaces(given_as):
    words = ["run/x,y", "--heights", *given_as, "--pair", *given_as, "--set", "hip.friction=0,1"]
    found = cli.read_options(Lists, "hop", None, [*words, "--no-video"])  # of older scripts
    assert found == Lists(("run/x,y",), (0.2, 0.3), (0.2, 0.3), ("hip.friction=0,1",))


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
    assert main(["robots", "list"]) == 0
    assert name in capsys.readouterr().out


def test_an_imported_leg_is_checked_and_what_was_assumed_is_listed(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    words = ["robots", "import", str(ROOT / "examples/leg.urdf"), "--out", "a leg.toml"]
    words += ["--motor", "ak80-9", "ak80-6", "--set", "knee.belt_ratio=1.5"]
    assert main(words) == main(["robots", "check", "a leg.toml"]) == 0
    said = capsys.readouterr().out
    assert "hip = -hip_pitch" in said
    assert said.count("rail.friction") == 1
    assert "knee.belt_ratio" not in said
    assert "valid robot: heron" in said
    assert "assumed: unknown until identified" in (tmp_path / "a leg.toml").read_text()


def test_a_terminal_is_asked_where_the_foot_is_and_nobody_else(tmp_path, monkeypatch, refused):
    text, file = (ROOT / "examples/leg.urdf").read_text(), tmp_path / "leg.urdf"
    file.write_text(text.replace("0 0 -0.165", "0 0.03 0"))
    words = ["robots", "import", str(file), "--motor", "qdd100", "--out", f"{tmp_path}/leg.toml"]
    refused(words, "stand foot, lower_leg, below it only the shank's centre of mass")
    typed = iter(["\n", "20 cm\n", "0.2\n"])
    echo = Mock(isatty=lambda: True, readline=lambda: print(file=sys.stderr) or next(typed))
    monkeypatch.setattr("sys.stdin", echo)
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    refused(words, "give the foot's distance through it")
    refused(words, "give a number in m")
    assert main(words) == 0
    shank = load_robot(tmp_path / "leg.toml").shank
    assert (shank.length, shank.com) == (0.2, pytest.approx(0.07 * 0.13 / 0.148, rel=1e-3))


def test_urdf_is_written_to_a_file_or_printed(tmp_path, capsys):
    file = tmp_path / "leg.urdf"
    assert main(["export", "urdf", "--out", str(file)]) == main(["export", "urdf"]) == 0
    assert file.read_text().startswith("<?xml")
    assert file.read_text() in capsys.readouterr().out


def test_what_a_terminal_cannot_encode_is_replaced(tmp_path):
    folder = tmp_path / "\u03c4"
    folder.mkdir()
    words = [sys.executable, "-m", "hopping_leg.cli", "export", "policy", "fast", "--out"]
    environment = {**os.environ, "TMPDIR": str(tmp_path), "PYTHONIOENCODING": "ascii"}
    words.append(str(folder / "fast.onnx"))
    done = subprocess.run(words, capture_output=True, cwd=tmp_path, env=environment)
    assert done.returncode == 0, done.stderr
    assert f"Wrote {tmp_path}/?/fast.onnx" in done.stdout.decode("ascii")
    assert sorted(path.name for path in tmp_path.iterdir()) == [folder.name], "onnxruntime, mujoco"


def test_a_renderer_that_is_not_there_is_one_sentence():
    words = [sys.executable, "-m", "hopping_leg.cli", "robots", "list"]
    done = subprocess.run(words, capture_output=True, env={**os.environ, "MUJOCO_GL": "osmosis"})
    assert done.returncode == FAILED
    assert re.fullmatch(rb"hop: .*MUJOCO_GL=osmosis.*unset.*\n", done.stderr)


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
    def wait():
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(10)

    assert calling(monkeypatch, wait) == cli.INTERRUPTED


@given(st.text() | st.binary().map(lambda data: data.decode(errors="surrogateescape")))
def test_an_error_is_one_printable_line_whatever_is_in_it(text):
    said = str(UsageError(f"'{text * 50}' is wrong."))
    assert said.isprintable()
    assert len(said) < 1300
