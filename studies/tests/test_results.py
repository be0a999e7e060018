"""What the studies store: each result is made by a command of the study, and is small."""

import json
import re
import shlex
from pathlib import Path

import pytest

from hopping_leg.cli import VERBS
from studies.shared import LONGEST, ROOT, condensed, results, store, stored_file

NAMES = sorted(path.parent.name for path in ROOT.glob("studies/*/__main__.py"))
LARGEST = 2_000_000


def words_of(command):
    """Return the words of a command without what has to be there or not before it."""
    return shlex.split(re.split(r"\|\||&&", command)[-1])


@pytest.mark.parametrize("name", NAMES)
def test_what_is_stored_is_made_by_a_command_of_the_study(name):
    made = {file: command for command in results(name) if (file := stored_file(command))}
    for path in ROOT.glob(f"studies/{name}/results/*"):
        assert json.loads(path.read_text())["command"] == made.get(path.relative_to(ROOT))


@pytest.mark.parametrize("name", NAMES)
def test_commands_are_verbs_or_studies(name):
    for command in results(name):
        words = words_of(command)
        if words[0] == "hop":
            assert words[1] in VERBS
        elif words[0] == "python":
            assert words[:2] == ["python", "-m"]
            assert words[2].split(".")[1] in NAMES
        else:
            assert words[0] == "cp"


@pytest.mark.parametrize("name", NAMES)
def test_what_a_command_reads_an_earlier_one_has_made(name):
    made: list[str] = []
    for command in " && ".join(results(name)).split(" && "):
        words = words_of(command)
        marks = [k for k, word in enumerate(words) if word in ("--out", "--traces", "--folder")]
        written = {words[k + 1] for k in marks}
        for word in words:
            path = word.rpartition("=")[2]
            if path.startswith("runs/") and Path(path).suffix and path not in written:
                assert any(path == file or path.startswith(f"{file}/") for file in made), path
        made += written


def test_a_price_on_power_makes_every_training_calm():
    rows = json.loads((ROOT / "studies/evaluation/results/calm.json").read_text())["summary"]
    hops = {row["controller"]: row for row in rows if row["command_m"] == 0.3}
    free = [row for name, row in hops.items() if "calm-0.0-" in name]
    paid = [row for name, row in hops.items() if "calm-0.0-" not in name]
    energy = max(row["electrical_energy_per_hop_j"] for row in paid)
    assert len(free) == 2
    assert len(paid) == 6
    assert 2 * energy < max(row["electrical_energy_per_hop_j"] for row in free)
    calmest = min(free, key=lambda row: row["electrical_energy_per_hop_j"])
    assert calmest["electrical_energy_per_hop_j"] < energy
    assert calmest["std_m"] < min(row["std_m"] for row in paid)


def test_results_are_small():
    files = [p for p in ROOT.glob("studies/*/results/*") if p.is_file()]
    assert sum(path.stat().st_size for path in files) < LARGEST


def test_what_is_stored_is_without_raw_numbers(tmp_path):
    raw = {
        "raw": [0.5] * (LONGEST + 1),
        "trials": 9,
        "rows": [{"a": 0.123456789, "names": ["x"] * 99}],
    }
    assert condensed(raw) == {"trials": 9, "rows": [{"a": 0.12346, "names": ["x"] * 99}]}
    file = tmp_path / "e.json"
    file.write_text(json.dumps(raw))
    store(file, "hop evaluate")
    assert json.loads(file.read_text()) == {**condensed(raw), "command": "hop evaluate"}
    assert Path(file).read_text().count("\n") == 10
    file.write_text(json.dumps({"pairs": [{"robot": "a", "hops": 9}] * 99}))
    store(file, "python")
    pairs = json.loads(file.read_text())["pairs"]
    assert pairs == {"columns": ["robot", "hops"], "rows": [["a", 9]] * 99}
