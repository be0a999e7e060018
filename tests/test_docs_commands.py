"""Every command and every snippet of the README and the documentation works as it stands there.

Each page is one sequence in a folder of its own, since later commands use files of earlier ones.
What makes commands short stands in ``doc_world``; behind every --transport stand drives in virtual
time.
"""

import contextlib
import functools
import importlib
import io
import re
import runpy
import subprocess
import sys
import tomllib
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

from hopping_leg import cli
from hopping_leg.controllers import RolloutConfig
from hopping_leg.controllers.registry import robot_of
from hopping_leg.evaluate.runner import evaluate, load_entries
from hopping_leg.robot import CONTROL_RATE, DEFAULT_ROBOT, load_robot
from tests.cli.emulated import put_behind
from tests.doc_pages import PAGES, ROOT, blocks, inline_commands
from tests.doc_world import (
    AFTER,
    BEFORE,
    CODES,
    ELSEWHERE,
    SECONDS,
    furnish,
    shorten,
    write_tutorial,
)

pytest.importorskip("moteus")
pytest.importorskip("torch")
pytest.importorskip("viser")
from tests.rl.learners import try_briefly

RUNNABLE = [page for page in PAGES if any(b.language in ("bash", "python") for b in blocks(page))]
WITH_KINDS = ("record", "export", "robots")  # Verbs whose options depend on the next word


@functools.cache
def help_of(*words):
    """Return the help of a verb, or of a kind of it where it has kinds."""
    text = io.StringIO()
    with contextlib.redirect_stdout(text), pytest.raises(SystemExit):
        cli.main([*words, "--help"])
    return text.getvalue()


@pytest.mark.parametrize("page", PAGES)
def test_options_in_running_text_exist_and_blocks_of_toml_are_toml(page):
    assert all(tomllib.loads(b.text) for b in blocks(page) if b.language == "toml")
    for _, verb, *words in inline_commands(page):
        if verb != "VERB" and not verb.startswith("-"):
            assert verb in cli.VERBS, words
            kinds = words[:1] if verb in WITH_KINDS else []
            for flag in {word for word in words if word.startswith("--") and word != "--help"}:
                assert re.search(rf"{flag}\b", help_of(verb, *kinds)), (verb, *words)


def test_the_tutorials_controllers_hop_as_the_page_says(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_tutorial()
    leg, names = load_robot(DEFAULT_ROBOT), ["Spring", "Pushing", "Aiming"]
    entries = load_entries([f"first.py:{name}" for name in names], leg, CONTROL_RATE)
    asked = {"commands": (0.25, 0.30, 0.35), "repeats": 2, "seed": 0, "kinds": ("fixed",)}
    rows = evaluate(entries, RolloutConfig(leg), **asked).evaluation.summary
    standing, pushing, aiming = rows[:3], rows[3:6], rows[6:]
    assert not any(row.hops for row in standing)
    apexes = [row.command_m + row.median_error_m for row in [*pushing, *aiming]]
    assert np.ptp(apexes[:3]) < 0.003
    assert (np.diff(apexes[3:]) > 0.02).all()
    assert max(abs(row.median_error_m) for row in aiming) < 0.05
    assert aiming[0].std_m < aiming[1].std_m < aiming[2].std_m


@pytest.mark.slow
@pytest.mark.parametrize("page", RUNNABLE)
def test_commands_and_snippets_work_in_their_order(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "agg")
    for name, seconds in SECONDS.items():
        monkeypatch.setattr(name, seconds)
    try_briefly(monkeypatch)
    furnish(page)
    names = {"__name__": page}
    exec(BEFORE.get(page, ""), names)
    for block in blocks(page):
        if block.language == "python":
            exec(block.text, names)
        for words in block.commands() if block.language == "bash" else ():
            print("$", *words)
            run(words, monkeypatch)
    exec(AFTER.get(page, ""), names)


def run(words, monkeypatch):
    """Run a command, or check what of it can be checked; what nobody knows fails."""
    program = words[0]
    if program == "hop":
        run_hop(words, monkeypatch)
    elif words[:2] == ["python", "-m"]:  # a study: its options must parse
        parse_study(words[2:], monkeypatch)
    elif program == "make":  # installs, or runs this test among others: its recipe must exist
        subprocess.run([*words, "--dry-run"], cwd=ROOT, check=True, capture_output=True)
    elif words[:2] == ["pip", "install"]:  # needs the network: its extra must exist
        extra = re.search(r"\[(.*)\]", words[-1])
        known = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
        assert extra is None or extra[1] in known["optional-dependencies"]
    else:
        assert words == [".", ".venv/bin/activate"]  # the shell's own


def run_hop(words, monkeypatch):
    command = " ".join(words)
    with monkeypatch.context() as patch:
        if command.startswith(ELSEWHERE):
            module = importlib.import_module(f"hopping_leg.cli.{words[1]}")
            patch.setattr(module, "run", functools.wraps(module.run)(lambda args: None))
        if "--transport" in words:
            robot = words[words.index("--robot") + 1] if "--robot" in words else robot_of(words)
            clamped = "fixed-base.parquet" in words
            robot = "real_leg.toml" if clamped else robot
            pose = "zero" if "--home" in words else "stand"
            put_behind(patch, robot=robot, pose=pose, clamped=clamped)
        if CODES.get(command) == cli.INTERRUPTED:
            tick = Mock(side_effect=KeyboardInterrupt)
            patch.setattr("hopping_leg.rl.train.Trainer.tick", tick)
        found = [sorted(map(str, Path().glob(w))) if "*" in w else [w] for w in shorten(words)[1:]]
        code = cli.main([word for some in found for word in some])
    assert code == CODES.get(command, 0), f"{command}: exit code {code}"


def parse_only(name, options, arguments):
    cli.read_options(options, name, None, arguments)
    return 0


def parse_study(words, monkeypatch):
    """Check a study's options without running it."""

    with monkeypatch.context() as patch:
        patch.setattr("studies.shared._run", parse_only)
        patch.setattr(sys, "argv", words)
        with pytest.raises(SystemExit) as ended:
            runpy.run_module(words[0], run_name="__main__")
    assert ended.value.code == 0
