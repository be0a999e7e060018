import dataclasses
import json
import logging

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper

from hopping_leg.controllers.policy import Policy
from hopping_leg.controllers.registry import load_controller, load_policy
from hopping_leg.errors import PolicyError, UsageError
from hopping_leg.robot import load_robot
from tests.controllers.measurements import measurement
from tests.rl.test_onnx_export import made, parts

ROBOT = load_robot("legv2-paper")


def loaded(count):
    policy = Policy(made(), "memory", "test")
    policy.reset(count)
    return policy


def test_card_survives_the_file(tmp_path):
    path = tmp_path / "a.onnx"
    path.write_bytes(made())
    assert Policy.load(path).card == parts("three-samples")[-1]
    assert Policy.load(path).name == "a"


def refused(tmp_path, model, says):
    path = tmp_path / "wrong.onnx"
    onnx.save(model, path)
    with pytest.raises(PolicyError, match=says):
        Policy.load(path)


def test_foreign_onnx_file_is_refused(tmp_path):
    node = helper.make_node("Relu", ["x"], ["y"])
    values = [helper.make_tensor_value_info(n, TensorProto.FLOAT, ["n", 2]) for n in "xy"]
    graph = helper.make_graph([node], "g", [values[0]], [values[1]])
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)])
    model.ir_version = 8
    refused(tmp_path, model, "not a policy")


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"schema": 99}, "schema 99"),
        ({"layout": "seven-samples"}, "three-samples"),
        ({"foo": 1}, "no field 'foo'"),
    ],
)
def test_wrong_metadata_is_refused(tmp_path, change, says):
    model = onnx.load_from_string(made())
    card = json.loads(model.metadata_props[0].value) | change
    model.metadata_props[0].value = json.dumps(card)
    refused(tmp_path, model, says)


def test_missing_file_and_unknown_name(tmp_path):
    with pytest.raises(PolicyError, match="Cannot read"):
        load_controller(tmp_path / "none.onnx", ROBOT)
    with pytest.raises(UsageError, match=r"'energy-shaping'.*path/to/file\.py:CLASS"):
        load_controller("energy-shapin", ROBOT)
    other = tmp_path / "weights.zip"
    other.write_bytes(b"PK")
    with pytest.raises(PolicyError, match=r"end in \.onnx"):
        load_controller(other, ROBOT)


def test_another_robot_is_refused_or_named(tmp_path, caplog):
    path = tmp_path / "a.onnx"
    path.write_bytes(made())
    other = dataclasses.replace(ROBOT, base=dataclasses.replace(ROBOT.base, mass=2.0))
    with pytest.raises(PolicyError, match="trained on robot 'legv2'"):
        load_controller(path, other, other="refuse")
    with caplog.at_level(logging.WARNING):
        load_controller(path, other)
    assert "trained on robot" in caplog.text
    caplog.clear()
    load_controller(path, other, other="accept")
    assert not caplog.text
    with pytest.raises(PolicyError, match="400 Hz"):
        load_policy(path).check_robot(ROBOT, 400.0)


@pytest.mark.parametrize("command", [0.1, 0.5, np.nan])
@pytest.mark.parametrize("count", [1, 3])
def test_command_out_of_range_is_refused(command, count):
    m = measurement(count)
    m.command[-1, 0] = command
    with pytest.raises(UsageError, match=r"0\.2 to 0\.4 m"):
        loaded(count).act(m)


def test_a_policy_for_any_leg_asks_which_and_acts_in_its_units():
    policy, big = load_policy("universal"), load_robot("legv1")
    policy.reset(1)
    with pytest.raises(UsageError, match="set_robot"):
        policy.act(measurement(1))
    shown, torques = measurement(1), []
    for robot in (load_robot("legv2"), big):
        policy.set_robot(robot)
        policy.reset(1)
        low, _high = policy.command_range
        torques.append(policy.act(dataclasses.replace(shown, command=np.full((1, 3), low))))
    assert policy.command_range == pytest.approx(np.array([0.7, 1.4]) * big.straight_height)
    assert np.abs(torques[0] - torques[1]).max() > 0.1
