import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hopping_leg.deploy.drive_link import JointTransform
from hopping_leg.deploy.preflight import DriveInfo, check_drives, require_fit, required_settings
from hopping_leg.deploy.safety_limits import hopping_limits
from hopping_leg.errors import HardwareError
from hopping_leg.robot import REGISTER_MAP, Hardware, load_robot
from hopping_leg.robot.hardware import Servo

LEG = load_robot("legv2")
LIMITS = hopping_limits(LEG, 200.0)


def healthy(joint, **changes):
    facts = {"answers": True, "register_map": REGISTER_MAP, "serial": f"{joint:024x}", "home": 2}
    facts |= {"position": (0.8, -1.6)[joint], "voltage": 24.0, "temperature": 30.0}
    facts["settings"] = {s.name: s.value for s in required_settings(LEG, joint)}
    return DriveInfo(**facts | changes)


def complaints(knee, robot=LEG):
    findings = check_drives(robot, LIMITS, (healthy(0), knee))
    return [finding.complaint for finding in findings if finding.complaint]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"answers": False}, "(id 2) does not answer"),
        ({"register_map": 4}, "register map 4 but this version speaks 5"),
        ({"mode": 1, "fault": 35}, "reports fault 35 (encoder)"),
        ({"voltage": 12.0}, "12.0 V but must lie between 18 and 42 V"),
        ({"voltage": math.nan}, "nan V but must lie"),
        ({"temperature": 70.0}, "has 70 deg C"),
        ({"home": 1}, "is not homed"),
        ({"position": 0.4}, "stands at 0.400 rad"),
        ({"position": math.nan}, "stands at nan rad"),
        ({"settings": {}}, "is nan but must be"),
    ],
)
def test_each_mistake_has_its_sentence(changes, words):
    found = complaints(healthy(1, **changes))
    assert found
    assert all("knee" in sentence for sentence in found)
    assert any(words in sentence for sentence in found)


def test_a_swapped_drive_is_noticed():
    hardware = replace(LEG.hardware, knee=Servo(id=2, serial="f" * 24))
    (sentence,) = complaints(healthy(1), replace(LEG, hardware=hardware))
    assert "swapped" in sentence


def test_the_first_complaint_is_raised_and_the_others_counted():
    findings = check_drives(LEG, LIMITS, (healthy(0), healthy(1, home=0, voltage=9.0)))
    with pytest.raises(HardwareError, match=r"bus voltage .* 1 more: see `hop doctor`"):
        require_fit(findings)


ANGLES = st.floats(-10, 10)
WIRES = st.builds(
    JointTransform, st.integers(1, 126), st.sampled_from([1.0, -1.0]), st.floats(0.5, 4), ANGLES
)


@given(WIRES, ANGLES, ANGLES)
def test_there_and_back_is_the_identity_and_power_is_kept(transform, angle, torque):
    assert transform.joint_position(transform.motor_position(angle)) == pytest.approx(
        angle, abs=1e-9
    )
    assert transform.joint_torque(transform.motor_torque(torque)) == pytest.approx(torque, abs=1e-9)
    at_motor = transform.motor_torque(torque) * math.tau * transform.motor_velocity(angle)
    assert at_motor == pytest.approx(torque * angle, abs=1e-9)


def test_limits_of_a_reversed_motor_stay_in_order():
    hip = replace(LEG.hip, stop_lower=-0.5, stop_upper=1.5)
    robot = replace(LEG, hip=hip, hardware=Hardware(hip=Servo(sign=-1.0)))
    found = {setting.name: setting for setting in required_settings(robot, 0)}
    low, high = found["servopos.position_min"], found["servopos.position_max"]
    assert low.value == pytest.approx(-1.5 / math.tau)
    assert high.value == pytest.approx(0.5 / math.tau)
    assert low.holds(float(low.text))
    assert not low.holds(-0.01)
