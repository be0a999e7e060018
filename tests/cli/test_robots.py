import json

import pytest

from hopping_leg.cli import main
from hopping_leg.cli.robots import numbers
from hopping_leg.robot import load_robot, load_tree, shipped_robots


def test_list_names_every_shipped_robot(capsys, tmp_path):
    file = tmp_path / "robots.json"
    assert main(["robots", "list", "--json", str(file)]) == 0
    shown = capsys.readouterr().out
    assert all(name in shown for name in shipped_robots())
    assert [robot["name"] for robot in json.loads(file.read_text())] == shipped_robots()


@pytest.mark.parametrize("name", shipped_robots())
def test_show_gives_every_number_with_unit_and_source(capsys, monkeypatch, name):
    monkeypatch.setenv("COLUMNS", "400")
    assert main(["robots", "show", name]) == 0
    shown = capsys.readouterr().out
    entries = numbers(load_tree(name))
    assert len(entries) > 30
    for path, entry in entries:
        line = next(line for line in shown.splitlines() if f" {path} " in line)
        assert f"{entry['value']:g}" in line
        assert entry["source"] in line


def test_check_accepts_the_example_and_show_writes_the_digest(tmp_path, capsys):
    assert main(["robots", "check", "examples/my_leg.toml"]) == 0
    assert "valid robot: my-leg" in capsys.readouterr().out
    file = tmp_path / "robot.json"
    assert main(["robots", "show", "legv2", "--json", str(file)]) == 0
    assert json.loads(file.read_text())["derived"]["digest"] == load_robot("legv2").digest


def test_urdf_is_written_to_a_file_or_printed(tmp_path, capsys):
    file = tmp_path / "leg.urdf"
    assert main(["export", "urdf", "--out", str(file)]) == main(["export", "urdf"]) == 0
    assert file.read_text().startswith("<?xml")
    assert file.read_text() in capsys.readouterr().out
