"""What a terminal shows: whole texts that are no markup, and how far work is."""

import io
import time

import pytest
from rich.console import Console
from rich.table import Table

from hopping_leg.cli.options import say, show_table
from hopping_leg.terminal import Progress, print_table, said_if_slow


def test_the_time_left_follows_the_pace(monkeypatch):
    now = 0.0
    monkeypatch.setattr(time, "monotonic", lambda: now)
    progress = Progress("fast seed 0")
    progress.show("fast seed 0", 1.0, about=", trying legs")
    progress.show("fast seed 0", 0.25)
    assert progress.text == "fast seed 0 25 %"
    now = 60.0
    progress.show("fast seed 0", 0.5, "2 hops")
    assert progress.text == "fast seed 0 50 % · 2 hops · 0:02:00 left"


def test_lines_come_while_nothing_is_reported_and_say_which_part_it_is(capsys, monkeypatch):
    monkeypatch.setattr("hopping_leg.terminal._SILENCE", 0.01)
    monkeypatch.setattr("hopping_leg.terminal._LINE_SECONDS", 0.02)
    with Progress(parts=2) as bar:
        bar.show("fast", 1.0)
        bar.show("slow", 0.5, about=", soft floor")
        time.sleep(0.2)
    lines = capsys.readouterr().err.splitlines()
    assert all(line.startswith("2 of 2: slow, soft floor 75 %") for line in lines[-3:])
    assert len(lines) >= 3


@pytest.mark.parametrize("terminal", [True, False])
def test_what_is_slow_says_what_it_does(capsys, monkeypatch, terminal):
    monkeypatch.setattr("hopping_leg.terminal._SILENCE", 0.05)
    monkeypatch.setattr("sys.stderr.isatty", lambda: terminal)
    with said_if_slow("Loading."):
        time.sleep(0.3)
    assert ("Loading." in capsys.readouterr().err.splitlines()) == terminal


@pytest.mark.parametrize("terminal", [True, False])
def test_no_character_of_a_table_is_lost(terminal):
    words = ["a long name", "thigh.inertia.xx", "one sentence of many words"]
    table = Table(*words)
    table.add_row(*words)
    shown = io.StringIO()
    print_table(table, Console(file=shown, width=30, force_terminal=terminal, color_system=None))
    letters = [c for c in shown.getvalue() if c.isalpha()]
    assert sorted(letters) == sorted(c for c in 2 * "".join(words) if c.isalpha())
    assert terminal or all(shown.getvalue().count(word) == 2 for word in words)


@pytest.mark.parametrize("text", ["[red]run[/red]", "[/]", "a :smile: b", "[link=x]"])
def test_no_text_of_a_user_is_taken_for_markup(capsys, monkeypatch, text):
    show_table(("name", text), [(text, 1)], text)
    say(text)
    monkeypatch.setattr("hopping_leg.terminal._SILENCE", 0.01)
    with Progress(text) as bar:
        bar.show(text, 0.5, text)
        time.sleep(0.1)
    captured = capsys.readouterr()
    assert captured.out.count(text) == 4
    assert captured.err.count(text) >= 1
