import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hopping_leg.deploy.drive_link import JointTransform, joint_transforms
from hopping_leg.deploy.preflight import required_settings
from hopping_leg.errors import RobotError
from hopping_leg.robot import Hardware, Servo, load_robot

ANGLES = st.floats(-10, 10)
WIRES = st.builds(
    JointTransform, st.integers(1, 126), st.sampled_from([1.0, -1.0]), st.floats(0.5, 4), ANGLES
)


def wired(tmp_path, text):
    file = tmp_path / "leg.toml"
    file.write_text(f'name = "t"\nextends = "legv2"\n{text}')
    return file


def entry(value, unit):
    return f'{{ value = {value}, unit = "{unit}", source = "[C]" }}'


@given(WIRES, ANGLES, ANGLES)
def test_there_and_back_is_the_identity_and_power_is_kept(transform, angle, torque):
    assert transform.joint_position(transform.motor_position(angle)) == pytest.approx(
        angle, abs=1e-9
    )
    assert transform.joint_torque(transform.motor_torque(torque)) == pytest.approx(torque, abs=1e-9)
    at_motor = transform.motor_torque(torque) * math.tau * transform.motor_velocity(angle)
    assert at_motor == pytest.approx(torque * angle, abs=1e-9)


def test_the_knee_turns_half_as_fast_as_its_motor():
    hip, knee = joint_transforms(load_robot("legv2"))
    assert (hip.id, knee.id) == (1, 2)
    assert hip.joint_velocity(1.0) == pytest.approx(math.tau)
    assert knee.joint_velocity(1.0) == pytest.approx(math.pi)
    assert knee.motor_torque(20.0) == pytest.approx(10.0)


def test_the_wiring_is_no_part_of_the_physics(tmp_path):
    text = f"[hardware.knee]\nid = {entry(7, '1')}\nsign = {entry(-1, '1')}\n"
    robot = load_robot(wired(tmp_path, text))
    assert joint_transforms(robot)[1].id == 7
    assert joint_transforms(robot)[1].sign == -1
    assert robot.digest == load_robot("legv2").digest


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (f"[hardware.knee]\nid = {entry(1, '1')}", "both 1"),
        (f"[hardware.hip]\nid = {entry(1.5, '1')}", "whole number"),
        (f"[hardware.hip]\nsign = {entry(0.5, '1')}", "1 or -1"),
        (f"[hardware.hip]\nlower = {entry(-2.0, 'rad')}", "write it as 'hip.stop_lower'"),
        (f"[hardware]\nvoltage_low = {entry(50, 'V')}", "voltage_high"),
        (f"[hardware]\nwatchdog = {entry(0, 's')}", "more than zero"),
        (f"[hardware]\nwatchdg = {entry(1, 's')}", "Did you mean 'watchdog'"),
    ],
)
def test_mistakes_get_a_sentence(tmp_path, text, sentence):
    with pytest.raises(RobotError, match=sentence):
        load_robot(wired(tmp_path, text))


def test_limits_of_a_reversed_motor_stay_in_order():
    robot = load_robot("legv2")
    hip = replace(robot.hip, stop_lower=-0.5, stop_upper=1.5)
    robot = replace(robot, hip=hip, hardware=Hardware(hip=Servo(sign=-1.0)))
    found = {setting.name: setting for setting in required_settings(robot, 0)}
    low, high = found["servopos.position_min"], found["servopos.position_max"]
    assert low.value == pytest.approx(-1.5 / math.tau)
    assert high.value == pytest.approx(0.5 / math.tau)
    assert low.holds(float(low.text))
    assert not low.holds(-0.01)
