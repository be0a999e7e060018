"""Tables of the documentation that judge, and commands that it shows."""

import importlib
import json
import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).parent.parent / "docs"

GOOD = {
    "controller": "quarter-0",
    "median_error_m": 0.001,
    "std_m": 0.003,
    "skipped_hops": 0,
    "body_contacts": 0,
    "hop_rate_hz": 2.0,
    "flight_fraction": 0.6,
}


@pytest.fixture
def macros(monkeypatch, tmp_path):
    """The macros of tables, which read from a folder of this test's own."""
    pytest.importorskip("mkdocs")
    monkeypatch.syspath_prepend(str(DOCS))
    results, precision = map(importlib.import_module, ("macros_results", "macros_precision"))
    monkeypatch.setattr(results, "RESULTS", tmp_path)
    yield precision, results
    for name in ("macros_results", "macros_precision"):
        sys.modules.pop(name, None)


def store(folder, rows):
    """Write an evaluation of these rows and return its name."""
    (folder / "e.json").write_text(json.dumps({"summary": rows, "command": "hop evaluate"}))
    return "e.json"


def last_cell(table):
    """Return the last cell of a table's first row."""
    return table.splitlines()[2].split("|")[-2].strip()


def test_a_table_says_whether_hops_are_as_asked(macros, tmp_path):
    for change, verdict in (({}, "yes"), ({"skipped_hops": 1}, "no")):
        file = store(tmp_path, [{**GOOD, "command_m": 0.3, **change}])
        assert last_cell(macros[0].precision(file, 0.4)) == verdict


def test_trainings_are_counted_and_other_controllers_are_not(macros, tmp_path):
    bad = {"skipped_hops": 2}
    rows = [
        {**GOOD, "command_m": 0.3},
        {**GOOD, "controller": "quarter-1", "command_m": 0.3, **bad},
        {**GOOD, "controller": "again", "command_m": 0.3, **bad},
    ]
    table = macros[0].trainings("quarter-", {"these": store(tmp_path, rows)})
    assert table.splitlines()[2].startswith("| these | 1 of 2 |")
    assert "| 0, 2 |" in table


def test_shown_commands_can_be_run_without_make(macros):
    shown = macros[1].commands()
    assert len(shown) > 20
    assert not [command for command in shown.values() if "$(" in command]
    assert (
        "quarter-seed4=runs/bench-quarter/precise-seed4/policy.onnx" in shown["precise-seeds.json"]
    )
