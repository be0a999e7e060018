"""Every command and every snippet of the README and the documentation works as it stands there.

Each page is one sequence in a folder of its own, since later commands use files of earlier ones.
What makes commands short, and which are tested elsewhere, stands in ``doc_world``; behind every
--transport stand drives in virtual time.
"""

import contextlib
import functools
import importlib
import io
import re
import runpy
import signal
import subprocess
import sys
import tomllib

import pytest

from hopping_leg.cli import VERBS, main, read_options
from hopping_leg.controllers.registry import robot_of
from tests.cli.emulated import put_behind
from tests.doc_pages import PAGES, ROOT, blocks, indented_commands, inline_commands, with_files
from tests.doc_world import BEFORE, ELSEWHERE, INTERRUPTED, REFUSED, SECONDS, furnish, shorten

pytest.importorskip("moteus")
pytest.importorskip("torch")
pytest.importorskip("viser")
from tests.rl.learners import try_briefly

WORK = 60
"""Time of the processor that a command may take, s; a longer one wants an entry in
``doc_world.SHORTER``."""

WAIT = 600
"""Time in which it must be over, s, however busy the computer is."""

RUNNABLE = [page for page in PAGES if any(b.language in ("bash", "python") for b in blocks(page))]


WITH_KINDS = ("record", "export", "robots")
"""Verbs whose options depend on the next word."""


class TooLongError(Exception):
    """A command went over its limit."""


@pytest.fixture(autouse=True)
def _alarm():
    """Let an alarm end what takes too long."""

    def end(number, frame):
        raise TooLongError(f"more than {WORK} s of work or {WAIT} s of waiting")

    before = {number: signal.signal(number, end) for number in (signal.SIGPROF, signal.SIGALRM)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


def test_no_command_hides_in_an_indented_block():
    assert {page: found for page in PAGES if (found := indented_commands(page))} == {}


def test_blocks_of_toml_are_toml():
    for text in (b.text for page in PAGES for b in blocks(page) if b.language == "toml"):
        assert tomllib.loads(text)


@functools.cache
def help_of(*words):
    """Return the help of a verb, or of a kind of it where it has kinds."""
    text = io.StringIO()
    with contextlib.redirect_stdout(text), pytest.raises(SystemExit) as ended:
        main([*words, "--help"])
    assert ended.value.code == 0, words
    return text.getvalue()


@pytest.mark.parametrize("page", PAGES)
def test_options_in_running_text_exist(page):
    for _, verb, *words in inline_commands(page):
        if verb == "VERB" or verb.startswith("-"):
            continue
        assert verb in VERBS, words
        kinds = words[:1] if verb in WITH_KINDS else []
        for flag in {word for word in words if word.startswith("--") and word != "--help"}:
            assert re.search(rf"{flag}\b", help_of(verb, *kinds)), (verb, *words)


@pytest.mark.slow
@pytest.mark.parametrize("page", RUNNABLE)
def test_commands_and_snippets_work_in_their_order(page, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "agg")
    for name, seconds in SECONDS.items():
        monkeypatch.setattr(name, seconds)
    try_briefly(monkeypatch)
    furnish(page)
    names = {"__name__": page}
    exec(BEFORE.get(page, ""), names)
    for block in blocks(page):
        if block.language == "python" and not block.is_example:
            with limited(block.where, block.text, capsys):
                exec(compile(block.text, block.where, "exec"), names)
        for words in block.commands() if block.language == "bash" else ():
            with limited(block.where, " ".join(words), capsys):
                run(words, monkeypatch)


@contextlib.contextmanager
def limited(where, text, capsys):
    """Let what fails or takes too long fail the test, with where it stands and what it said."""
    signal.setitimer(signal.ITIMER_PROF, WORK)
    signal.alarm(WAIT)
    try:
        yield
    except (AssertionError, SystemExit, TooLongError) as error:
        said = capsys.readouterr()
        pytest.fail(f"{where}: {text}: {error!r}\n{said.out[-2000:]}{said.err[-2000:]}", False)
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.alarm(0)


def run(words, monkeypatch):
    """Run a command, or check what of it can be checked; what nobody knows fails."""
    program = words[0]
    if program == "hop":
        run_hop(words, monkeypatch)
    elif words[:2] == ["python", "-m"]:  # a study: its options must parse
        parse_study(words[2:], monkeypatch)
    elif program == "python":
        monkeypatch.setattr(sys, "argv", words[1:])
        runpy.run_path(words[1], run_name="__main__")
    elif program == "make":  # installs, or runs this test among others: its recipe must exist
        subprocess.run([*words, "--dry-run"], cwd=ROOT, check=True, capture_output=True)
    elif words[:2] == ["pip", "install"]:  # needs the network: its extra must exist
        extra = re.search(r"\[(.*)\]", words[-1])
        known = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
        assert extra is None or set(extra[1].split(",")) <= known["optional-dependencies"].keys()
    else:
        assert words == [".", ".venv/bin/activate"]  # the shell's own


def run_hop(words, monkeypatch):
    command = " ".join(words)
    if not words[1].startswith("-"):
        parse(words, monkeypatch)
    if any(command.startswith(known) for known in ELSEWHERE):
        return
    with monkeypatch.context() as patch:
        if "--transport" in words:
            robot = words[words.index("--robot") + 1] if "--robot" in words else robot_of(words)
            pose, clamped = "zero" if "--home" in words else "stand", "fixed-base.parquet" in words
            put_behind(
                patch, robot="real_leg.toml" if clamped else robot, pose=pose, clamped=clamped
            )
        if command in INTERRUPTED:
            patch.setattr("hopping_leg.rl.train.Trainer.tick", interrupt)
        code = main(with_files(shorten(words)[1:]))
    assert code == {**INTERRUPTED, **REFUSED}.get(command, 0), f"exit code {code}"


def interrupt(trainer):
    raise KeyboardInterrupt


def parse(words, monkeypatch):
    """Check a command's own options, before they are made short."""
    module, seen = importlib.import_module(f"hopping_leg.cli.{words[1]}"), []

    @functools.wraps(module.run)
    def note(args):
        seen.append(args)

    with monkeypatch.context() as patch:
        patch.setattr(module, "run", note)
        assert main(words[1:]) == 0
    assert len(seen) == 1


def parse_study(words, monkeypatch):
    """Check a study's options without running it."""

    def parse_only(name, options, arguments):
        read_options(options, name, None, arguments)
        return 0

    with monkeypatch.context() as patch:
        patch.setattr("studies.shared._run", parse_only)
        patch.setattr(sys, "argv", words)
        with pytest.raises(SystemExit) as ended:
            runpy.run_module(words[0], run_name="__main__")
    assert ended.value.code == 0
