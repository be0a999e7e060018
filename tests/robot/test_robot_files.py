import dataclasses
import functools
import itertools
import math
import tomllib
from operator import getitem

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hopping_leg.controllers.rollout import RolloutConfig
from hopping_leg.deploy.drive_link import joint_transforms
from hopping_leg.envs import HoppingEnv
from hopping_leg.errors import RobotError
from hopping_leg.robot import JOINTS, NO_MISMATCH, build_model, load_robot, robot_files
from hopping_leg.robot.hardware import HeightSensor
from tests.robot.files import UNITS, whole, written

SIGNED = ("lower", "upper", "stop_lower", "stop_upper")
EXAMPLE = "examples/my_leg.toml"


def put(entry, value):
    return lambda table, key: table[key].__setitem__(entry, value)


MISTAKES = {
    "missing": lambda table, key: table.pop(key),
    "unknown": lambda table, key: table.__setitem__(key + "x", table[key]),
    "bare": lambda table, key: table.__setitem__(key, 1.0),
    "text": put("value", "heavy"),
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
    for robot in map(load_robot, robot_files.shipped_robots()):
        free = {"stop_lower": math.nan, "stop_upper": math.nan}
        joints = {name: dataclasses.replace(getattr(robot, name), **free) for name in JOINTS}
        bare = dataclasses.replace(robot, **joints)
        for key in free:
            np.testing.assert_allclose(bare.of_joints(key), robot.of_joints(key), atol=0.02)


def test_a_stop_is_physics_but_digests_that_leave_it_out_are_known():
    robot = load_robot("legv2-paper")
    assert robot.has_digest(robot.digest)
    assert robot.has_digest("9634a0cc2dd452ea")  # of policies' files
    other = dataclasses.replace(robot, hip=dataclasses.replace(robot.hip, stop_upper=3.0))
    assert other.digest != robot.digest
    assert not other.has_digest(robot.digest)


@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(path=st.sampled_from(sorted(UNITS)), mistake=st.sampled_from(sorted(MISTAKES)))
def test_every_mistake_gets_a_sentence_that_names_the_field(tmp_path, path, mistake):
    *tables, name = path.split(".")
    if mistake == "negative" and name in SIGNED:
        return
    if mistake == "missing" and name.startswith("stop_"):  # may be left out
        return
    file = whole(
        tmp_path / "leg.toml",
        lambda tree: MISTAKES[mistake](functools.reduce(getitem, tables, tree), name),
    )
    with pytest.raises(RobotError) as caught:
        load_robot(file)
    message = str(caught.value)
    assert file in message
    assert name in message or f"it needs a table [{tables[-1]}]" in message
    assert "\n" not in message


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        ("base = [", "not valid TOML"),
        ("base = 3", "'base': Expected"),
        ('extends = "legv2"\nkind = "log"', "Did you mean 'leg'"),
        ("extends = 3", "'extends' must be"),
        ('extends = "legv3"', "Did you mean 'legv"),
        ('extends = "leg.toml"', "circle"),
        ('extends = "legv2"\n[hip]\nbelt_ration = 1', "Did you mean 'belt_ratio'"),
        ('extends = "legv2"\n[hardware.height]\nsource = "encoder_1"', "mean 'encoder_1_position'"),
    ],
)
def test_broken_files_get_a_sentence(tmp_path, content, sentence):
    (tmp_path / "leg.toml").write_bytes(content.encode("latin-1"))
    with pytest.raises(RobotError, match=sentence):
        load_robot(tmp_path / "leg.toml")


@pytest.mark.parametrize("name", ["legv3", "nowhere/leg.toml", "", "../legv2"])
def test_unknown_robots_are_told_the_valid_names(name):
    with pytest.raises(RobotError, match="legv2-paper"):
        load_robot(name)


def test_a_part_may_be_left_out_and_the_wiring_is_no_part_of_the_physics(tmp_path):
    def leg(numbers):
        return load_robot(written(tmp_path / "leg.toml", numbers, "legv2"))

    knee = dataclasses.replace(NO_MISMATCH.knee, backlash=0.002)
    loose = leg({"reality.knee.backlash": (0.002, "rad")})
    assert loose.reality == dataclasses.replace(NO_MISMATCH, knee=knee)
    wired = leg({"hardware.knee.id": (7, "1"), "hardware.knee.sign": (-1, "1")})
    assert [(joint.id, joint.sign) for joint in joint_transforms(wired)] == [(1, 1), (7, -1)]
    assert wired.digest == load_robot("legv2").digest


@pytest.mark.parametrize(
    ("path", "value", "unit", "sentence"),
    [
        ("hip.lower", 3.0, "rad", "hip.upper"),
        ("knee.upper", 0.5, "rad", "knee.upper.*pendulum"),
        ("hip.upper", 68.0, "rad", "'hip.stop_upper', the mechanical stop .in degrees"),
        ("thigh.com", 0.4, "m", "thigh.length"),
        ("hip.motor.torque_limit", 40.0, "N m", "hip.motor.peak_torque"),
        ("contact.time_constant", 1e-4, "s", "contact.time_constant"),
        ("reality.knee.stiffness", 0.0, "N m/rad", "more than zero"),
        ("reality.knee.efficiency", 1.2, "1", "between 0 and 1"),
        ("reality.hip.torque_limit", 99.0, "N m", "hip.motor.peak_torque"),
        ("reality.latency.command", 0.01, "ms", "must be in 's'"),
        ("reality.latency.comand", 0.01, "s", "Did you mean 'command'"),
        ("hardware.knee.id", 1, "1", "both 1"),
        ("hardware.hip.id", 1.5, "1", "whole number"),
        ("hardware.voltage_low", 50, "V", "voltage_high"),
        ("hardware.watchdog", 0.11, "s", "default_timeout_s"),
        ("hardware.watchdog", 1e-4, "s", "default_timeout_s"),
        ("hardware.temperature_limit", 76.0, "deg C", "trip at 75"),
        ("hardware.voltage_high", 46.5, "V", "trip at 46"),
        ("hardware.knee.max_current", 101.0, "A", "r4"),
        ("hip.motor.peak_torque", 48.0, "N m", "max_current"),
        ("knee.motor.no_load_speed", 78.0, "rad/s", "voltage_high"),
        ("hip.stop_upper", 6.4, "rad", "turns more than once"),
        ("hardware.height.scale", 0.0, "m", "must not be zero"),
    ],
)
def test_numbers_that_cannot_be_name_the_fields(tmp_path, path, value, unit, sentence):
    with pytest.raises(RobotError, match=sentence) as caught:
        load_robot(written(tmp_path / "leg.toml", {path: (value, unit)}, "legv2"))
    assert path.partition(".")[0] in str(caught.value)


def test_a_height_sensor_tells_the_height_that_it_reads():
    pot = HeightSensor("aux2_analog_in1", zero=0.1, offset=0.2, scale=0.5)
    assert pot.height(0.5) == pytest.approx(0.4)
    boom = HeightSensor("encoder_1_position", zero=0.9, offset=0.4, radius=1.0, angle=-math.tau)
    assert boom.height(0.9 - 1 / 12) == pytest.approx(0.9)
    assert boom.height((0.9 + 1 / 6) % 1) == pytest.approx(0.4 - math.sin(math.pi / 3))
    for sensor, height in itertools.product((pot, boom), (0.1, 0.4, 0.55)):
        assert sensor.height(sensor.reading(height)) == pytest.approx(height)
    assert boom.reading(9.0) == pytest.approx(0.9 - 0.25), "as far as the boom reaches"
    assert all(math.isnan(pot.height(nothing)) for nothing in (math.nan, math.inf))


def test_a_limit_may_be_what_the_hardware_holds(tmp_path):
    most = {"watchdog": (0.1, "s"), "temperature_limit": (75.0, "deg C"), "voltage_high": (46, "V")}
    numbers = {f"hardware.{name}": entry for name, entry in most.items()}
    load_robot(written(tmp_path / "leg.toml", numbers, "legv2"))


@pytest.mark.parametrize("name", robot_files.shipped_robots())
def test_a_robot_comes_back_from_the_tables_that_are_made_of_it(name):
    robot = load_robot(name)
    tables = tomllib.loads(robot_files.robot_text(robot_files.robot_tree(robot, "a test")))
    assert robot_files.robot_from_tree(tables, "its file") == robot
