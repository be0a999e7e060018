import copy
import dataclasses
import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hopping_leg.controllers.rollout import RolloutConfig
from hopping_leg.deploy.drive_link import joint_transforms
from hopping_leg.envs import HoppingEnv
from hopping_leg.errors import RobotError
from hopping_leg.robot import NO_MISMATCH, build_model, load_robot, load_tree, shipped_robots

SIGNED = ("lower", "upper", "stop_lower", "stop_upper")
EXAMPLE = "examples/my_leg.toml"


def numbers(tree, path=()):
    for key, value in tree.items():
        if isinstance(value, dict):
            yield from [(*path, key)] if "value" in value else numbers(value, (*path, key))


PATHS = sorted(numbers(load_tree("legv2")))


def write_toml(tree, path):
    def text(value):
        if isinstance(value, dict):
            return "{" + ", ".join(f"{k} = {text(v)}" for k, v in value.items()) + "}"
        if isinstance(value, bool):
            return str(value).lower()
        return f'"{value}"' if isinstance(value, str) else repr(value)

    path.write_text("".join(f"{key} = {text(value)}\n" for key, value in tree.items()))


def changed(path, change):
    """Return legv2's tables with ``change(table, key)`` done to one number's place."""
    tree = copy.deepcopy(load_tree("legv2"))
    table = tree
    for key in path[:-1]:
        table = table[key]
    change(table, path[-1])
    return tree


def put(entry, value):
    return lambda table, key: table[key].__setitem__(entry, value)


MISTAKES = {
    "missing": lambda table, key: table.pop(key),
    "unknown": lambda table, key: table.__setitem__(key + "x", table[key]),
    "bare": lambda table, key: table.__setitem__(key, 1.0),
    "text": put("value", "heavy"),
    "bool": put("value", True),
    "nan": put("value", math.nan),
    "infinite": put("value", math.inf),
    "unit": put("unit", "furlong"),
    "no source": put("source", " "),
    "no unit": lambda table, key: table[key].pop("unit"),
    "extra": put("sauce", "a typo"),
    "negative": put("value", -1.0),
}


def test_a_file_may_change_only_what_differs():
    mine, parent = load_robot(EXAMPLE), load_robot("legv2-paper")
    assert mine.shank.length != parent.shank.length
    assert mine.thigh.inertia == parent.thigh.inertia
    assert mine.digest != parent.digest
    assert build_model(mine).nv == 3


def test_a_pendulum_swings_freely_but_cannot_hop():
    pendulum = load_robot("doublependulum")
    assert pendulum.knee.lower < 0 < pendulum.knee.upper
    with pytest.raises(RobotError, match="is a pendulum and cannot hop"):
        RolloutConfig(pendulum)
    with pytest.raises(RobotError, match="is a pendulum and cannot hop"):
        HoppingEnv("doublependulum")


def test_a_leg_that_states_no_stops_has_leg_v2s_and_a_pendulum_none_within_a_turn():
    for name in shipped_robots():
        robot = load_robot(name)
        free = {
            joint: dataclasses.replace(
                getattr(robot, joint), stop_lower=math.nan, stop_upper=math.nan
            )
            for joint in ("hip", "knee")
        }
        bare = dataclasses.replace(robot, **free)
        for key in ("stop_lower", "stop_upper"):
            np.testing.assert_allclose(bare.of_joints(key), robot.of_joints(key), atol=0.02)


def test_a_stop_is_physics_but_digests_that_leave_it_out_are_known():
    robot = load_robot("legv2-paper")
    assert robot.has_digest(robot.digest)
    assert robot.has_digest("9634a0cc2dd452ea")  # of policies' files
    other = dataclasses.replace(robot, hip=dataclasses.replace(robot.hip, stop_upper=3.0))
    assert other.digest != robot.digest
    assert not other.has_digest(robot.digest)


@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(path=st.sampled_from(PATHS), mistake=st.sampled_from(sorted(MISTAKES)))
def test_every_mistake_gets_a_sentence_that_names_the_field(tmp_path, path, mistake):
    if mistake == "negative" and path[-1] in SIGNED:
        return
    if mistake == "missing" and path[-1].startswith("stop_"):  # may be left out
        return
    file = tmp_path / "leg.toml"
    write_toml(changed(path, MISTAKES[mistake]), file)
    with pytest.raises(RobotError) as caught:
        load_robot(file)
    message = str(caught.value)
    assert str(file) in message
    assert path[-1] in message
    assert "\n" not in message


@pytest.mark.parametrize(
    ("path", "value", "named"),
    [
        ("hip.lower", 3.0, "hip.upper"),
        ("knee.upper", 0.5, "knee.upper.*pendulum"),
        ("hip.upper", 68.0, "beyond the mechanical stop 'hip.stop_upper'"),
        ("knee.stop_lower", -2.0, "'knee.lower'.*'knee.stop_lower'"),
        ("thigh.com", 0.4, "thigh.length"),
        ("hip.motor.torque_limit", 40.0, "hip.motor.peak_torque"),
        ("knee.motor.rated_torque", 17.0, "knee.motor.peak_torque"),
        ("contact.time_constant", 1e-4, "contact.time_constant"),
    ],
)
def test_contradictions_name_the_fields(tmp_path, path, value, named):
    file = tmp_path / "leg.toml"
    write_toml(changed(path.split("."), put("value", value)), file)
    with pytest.raises(RobotError, match=named):
        load_robot(file)


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        ("base = [", "not valid TOML"),
        ("\xff", "not valid TOML"),
        ("base = 3", "'name' is missing"),
        ('name = "x"\nbase = 3', "'base' must be a table"),
        ("name = 3", "'name' is 3 but must be a text"),
        ('extends = "legv2"\nkind = "log"', "Did you mean 'leg'"),
        ('name = " "\nextends = "legv2"', "'name' is empty"),
        ("extends = 3", "'extends' must be"),
        ('extends = "legv3"', "Did you mean 'legv"),
        ('extends = "leg.toml"', "circle"),
        ('extends = "legv2"\ncolour = "red"', "There is no field 'colour'"),
        ('extends = "legv2"\n[hip]\nbelt_ration = 1', "Did you mean 'belt_ratio'"),
    ],
)
def test_broken_files_get_a_sentence(tmp_path, content, sentence):
    file = tmp_path / "leg.toml"
    file.write_bytes(content.encode("latin-1"))
    with pytest.raises(RobotError, match=sentence):
        load_robot(file)


@pytest.mark.parametrize("name", ["legv3", "nowhere/leg.toml", "", "../legv2"])
def test_unknown_robots_are_told_the_valid_names(name):
    with pytest.raises(RobotError, match="legv2-paper"):
        load_robot(name)


@pytest.mark.parametrize(("name", "value"), [("load_friction", 0.05), ("torque_gain", 0.9)])
def test_what_a_drive_may_leave_out_changes_a_robot_only_where_it_is_stated(name, value):
    robot = load_robot("legv2")
    neutral = 0.0 if name == "load_friction" else 1.0
    for stated, same in ((neutral, True), (value, False)):
        hip = dataclasses.replace(robot.hip, **{name: stated})
        assert (dataclasses.replace(robot, hip=hip).digest == robot.digest) == same


def extended(folder, part, **entries):
    """Write a file that changes numbers ``(value, unit)`` of a part of legv2; return its path."""
    lines = ['name = "t"', 'extends = "legv2"', f"[{part}]"]
    for name, (value, unit) in entries.items():
        lines.append(f'{name} = {{ value = {value}, unit = "{unit}", source = "[C]" }}')
    (folder / "leg.toml").write_text("\n".join(lines))
    return folder / "leg.toml"


def test_a_part_may_be_left_out_and_the_wiring_is_no_part_of_the_physics(tmp_path):
    reality = load_robot(extended(tmp_path, "reality.knee", backlash=(0.002, "rad"))).reality
    assert reality.knee.backlash == 0.002
    assert reality.hip == NO_MISMATCH.hip
    assert reality.latency == NO_MISMATCH.latency
    wired = load_robot(extended(tmp_path, "hardware.knee", id=(7, "1"), sign=(-1, "1")))
    assert [(joint.id, joint.sign) for joint in joint_transforms(wired)] == [(1, 1), (7, -1)]
    assert wired.digest == load_robot("legv2").digest


@pytest.mark.parametrize(
    ("part", "field", "value", "unit", "sentence"),
    [
        ("reality.knee", "backlash", -0.1, "rad", "zero or more"),
        ("reality.knee", "stiffness", 0.0, "N m/rad", "more than zero"),
        ("reality.knee", "efficiency", 1.2, "1", "no gear gives more"),
        ("reality.hip", "stiction", 0.5, "1", "give 1 or more"),
        ("reality.hip", "torque_limit", 99.0, "N m", "hip.motor.peak_torque"),
        ("reality.ground", "time_constant", 1e-4, "s", "two physics steps"),
        ("reality.latency", "command", 0.01, "ms", "must be in 's'"),
        ("reality.latency", "comand", 0.01, "s", "Did you mean 'command'"),
        ("hardware.knee", "id", 1, "1", "both 1"),
        ("hardware.hip", "id", 1.5, "1", "whole number"),
        ("hardware.hip", "sign", 0.5, "1", "1 or -1"),
        ("hardware.hip", "lower", -2.0, "rad", "write it as 'hip.stop_lower'"),
        ("hardware", "voltage_low", 50, "V", "voltage_high"),
        ("hardware", "watchdog", 0, "s", "more than zero"),
        ("hardware", "watchdg", 1, "s", "Did you mean 'watchdog'"),
    ],
)
def test_mistakes_in_a_part_that_may_be_left_out_get_a_sentence(
    tmp_path, part, field, value, unit, sentence
):
    with pytest.raises(RobotError, match=sentence) as caught:
        load_robot(extended(tmp_path, part, **{field: (value, unit)}))
    assert part.partition(".")[0] in str(caught.value)
