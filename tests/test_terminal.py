"""What a terminal shows: whole texts that are no markup, and how far work is."""

import io

import pytest
from rich.console import Console
from rich.table import Table

from hopping_leg.cli.options import say, show_table
from hopping_leg.terminal import Progress, print_table


def test_where_there_is_no_terminal_lines_say_which_part_it_is(capsys, monkeypatch):
    monkeypatch.setattr("hopping_leg.terminal._LINE_SECONDS", 0.0)
    with Progress(parts=2) as bar:
        bar.show("fast", 1.0)
        bar.show("slow", 0.5, "2 hops", about=", soft floor")
    lines = capsys.readouterr().err.splitlines()
    assert lines == ["1 of 2: fast 50 %", "2 of 2: slow, soft floor 75 %, 1 s left 2 hops"]


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
    monkeypatch.setattr("hopping_leg.terminal._LINE_SECONDS", 0.0)
    with Progress(text) as bar:
        bar.show(text, 0.5, text)
    captured = capsys.readouterr()
    assert captured.out.count(text) == 4
    assert captured.err.count(text) == 2
