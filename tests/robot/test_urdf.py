from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings

from hopping_leg.robot import dynamics, load_robot, shipped_robots, to_urdf
from tests.robot.legs import SEEDS, posed, random_robot, random_state


@settings(max_examples=25)
@given(SEEDS)
def test_mujoco_reads_the_same_dynamics_from_the_urdf(seed):
    rng = np.random.default_rng(seed)
    robot = random_robot(rng)
    model = mujoco.MjModel.from_xml_string(to_urdf(robot))
    assert [model.joint(i).name for i in range(3)] == ["rail", "hip", "knee"]
    height, rate, q, qd = random_state(rng)
    data = posed(model, height, rate, q, qd)
    full = np.zeros((3, 3))
    mujoco.mj_fullM(model, data, full)
    full += np.diag([0, robot.hip.armature, robot.knee.armature])
    np.testing.assert_allclose(dynamics.mass_matrix(robot, q)[0], full, rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(
        dynamics.bias_force(robot, q, qd)[0], data.qfrc_bias, rtol=1e-7, atol=1e-9
    )


@pytest.mark.parametrize("name", shipped_robots())
def test_limits_and_belt_stand_in_the_file(name):
    robot = load_robot(name)
    root = ElementTree.fromstring(to_urdf(robot))
    for joint in ("hip", "knee"):
        parameters = getattr(robot, joint)
        limit = root.find(f"joint[@name='{joint}']/limit").attrib
        assert float(limit["effort"]) == parameters.torque_limit
        assert float(limit["velocity"]) == parameters.no_load_speed
        assert float(limit["lower"]) == parameters.stop_lower
        soft = root.find(f"joint[@name='{joint}']/safety_controller").attrib
        assert float(soft["soft_upper_limit"]) == parameters.upper
        reduction = root.find(f"transmission[@name='{joint}_belt']/actuator/mechanicalReduction")
        assert float(reduction.text) == parameters.belt_ratio
