"""Tables of the documentation that judge, and the results that they show."""

import importlib
import json
import sys
from pathlib import Path

import pytest

from tests.evaluate.test_acceptance import GOOD

DOCS = Path(__file__).parent.parent / "docs"


@pytest.fixture
def macros(monkeypatch, tmp_path):
    """The macros of tables, which read from a folder of this test's own."""
    pytest.importorskip("mkdocs")
    monkeypatch.syspath_prepend(str(DOCS))
    found = importlib.import_module("macros_results")
    monkeypatch.setattr(found, "STUDIES", tmp_path)
    yield found
    sys.modules.pop("macros_results", None)


def store(folder, rows):
    """Write a result of these rows and return its name."""
    file = folder / "s" / "results" / "e.json"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps({"summary": rows, "command": "hop evaluate"}))
    return "s/e.json"


def test_a_table_says_whether_hops_are_as_asked(macros, tmp_path):
    for change, verdict in (({}, "yes"), ({"skipped_hops": 1}, "no")):
        file = store(tmp_path, [{**GOOD, "command_m": 0.3, **change}])
        table = macros.precision(file, 0.4)
        assert table.splitlines()[2].split("|")[-2].strip() == verdict
        assert "made by `hop evaluate`" in table


def test_a_rival_is_beaten_only_where_intervals_are_apart(macros, tmp_path):
    def row(controller, command, middle):
        ends = {"low": middle - 0.001, "high": middle + 0.001}
        both = {f"{m}_{k}_m": v for m in ("mean_abs_error", "std") for k, v in ends.items()}
        return {"controller": controller, "command_m": command, "flight_fraction": command, **both}

    rows = [row("rival", c, 0.010) for c in (0.3, 0.4, 0.6)]
    rows += [row("mine", c, m) for c, m in ((0.3, 0.005), (0.4, 0.0115), (0.6, 0.015))]
    cells = macros.against(store(tmp_path, rows), "rival").splitlines()[2].split("|")
    assert cells[1].strip() == "mine"
    assert cells[2].strip() == "smaller at 1, larger at 1, not told apart at 1"
    assert cells[4].strip() == "smaller at 0, larger at 1, not told apart at 0"


def test_records_are_set_out_by_two_keys(macros, tmp_path):
    rows = [{**GOOD, "command_m": c, "controller": n} for c in (0.2, 0.3) for n in "ab"]
    table = macros.pivot(store(tmp_path, rows), "summary", "command_m", "controller", "{std_m:.3f}")
    assert table.splitlines()[0] == "| command_m | a | b |"
    assert table.splitlines()[3] == "| 0.3 | 0.003 | 0.003 |"
