import dataclasses
import tomllib

import numpy as np
import pytest

from hopping_leg.errors import RobotError
from hopping_leg.identify.robot_file import save_robot
from hopping_leg.robot import load_robot
from hopping_leg.robot.robot_files import load_tree
from tests.identify.fitting import TRUTH, identified


def test_the_file_is_the_robot_that_was_identified(tmp_path):
    path = tmp_path / "mine.toml"
    save_robot(identified(), path, "legv2")
    robot = load_robot(path)
    assert robot.name == "mine"
    assert robot.digest == identified().robot.digest


def test_every_identified_number_says_so_and_all_others_stay(tmp_path):
    path = tmp_path / "mine.toml"
    save_robot(identified(), path, "legv2")
    tree, before = load_tree(path), load_tree("legv2")
    assert tree["hip"]["friction"]["source"].startswith("identified: 95 % ")
    assert "start 0.0412" in tree["hip"]["friction"]["source"]
    for name in TRUTH:
        joint, field = name.split(".")
        before[joint][field] = tree[joint][field]
    assert {**tree, "name": "", "description": ""} == {**before, "name": "", "description": ""}


def test_provenance_stands_above_the_numbers(tmp_path):
    path = tmp_path / "mine.toml"
    save_robot(identified(), path, "legv2")
    comments = [line for line in path.read_text().splitlines() if line.startswith("#")]
    text = "\n".join(comments)
    for part in (
        "swing 0.0, 0.0-4.5 s",
        "seed 0",
        "mujoco",
        "least-squares",
        "position, closed loop: ",
    ):
        assert part in text


def found_of(name, unit, value):
    """Return the identification as if its second parameter had been another."""
    found = identified()
    values = np.array([found.identifiability.values[0], value])
    known = dataclasses.replace(found.identifiability, names=["hip.friction", name], values=values)
    start = found.passes[-1].parameters.parameters[0]
    parameters = dataclasses.replace(
        found.passes[-1].parameters,
        parameters=(start, dataclasses.replace(start, name=name, unit=unit)),
    )
    last = dataclasses.replace(found.passes[-1], parameters=parameters)
    return dataclasses.replace(found, identifiability=known, passes=(last,))


def test_what_belongs_to_the_rig_stays_out_of_the_robot(tmp_path):
    path = tmp_path / "mine.toml"
    save_robot(found_of("drive.hip.stiffness", "N m/rad", 9.0), path, "legv2")
    assert "drive" not in tomllib.loads(path.read_text())
    assert "#   drive.hip.stiffness = 9 N m/rad" in path.read_text()


@pytest.mark.parametrize(("delay", "latency"), [(0.003, 0.003), (0.0, 0.0)])
def test_a_delay_that_was_found_is_one_that_training_has(tmp_path, delay, latency):
    path = tmp_path / "mine.toml"
    save_robot(found_of("drive.delay", "s", delay), path, "legv2")
    robot = load_robot(path)
    assert robot.reality.latency.command == latency
    assert robot.reality.only_delays
    assert ("reality" in tomllib.loads(path.read_text())) == (delay > 0)


def test_an_impossible_robot_is_not_written(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text("old")
    values = np.array([-1.0, 0.1])
    found = dataclasses.replace(
        identified(),
        identifiability=dataclasses.replace(identified().identifiability, values=values),
    )
    with pytest.raises(RobotError, match=r"hip\.friction"):
        save_robot(found, path, "legv2")
    assert path.read_text() == "old"
