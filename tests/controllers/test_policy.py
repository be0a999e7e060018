import dataclasses
import json

import numpy as np
import onnx
import pytest
from onnx import helper

from hopping_leg.controllers.policy import METADATA_KEY, Policy
from hopping_leg.controllers.registry import load_controller, load_policy
from hopping_leg.errors import PolicyError, UsageError
from hopping_leg.robot import load_robot
from tests.controllers.measurements import measurement
from tests.rl.test_onnx_export import made

ROBOT = load_robot("legv2-paper")


@pytest.fixture
def file(tmp_path):
    """A policy file."""
    (tmp_path / "a.onnx").write_bytes(made())
    return tmp_path / "a.onnx"


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (None, "not a policy"),
        ({"schema": 99}, "schema 99"),
        ({"layout": "seven-samples"}, "three-samples"),
        ({"foo": 1}, "no field 'foo'"),
    ],
)
def test_a_file_without_a_card_or_with_a_wrong_one_is_refused(change, says):
    model = onnx.load_from_string(made())
    card = json.loads(model.metadata_props[0].value) | (change or {})
    del model.metadata_props[:]
    if change:
        helper.set_model_props(model, {METADATA_KEY: json.dumps(card)})
    with pytest.raises(PolicyError, match=says):
        Policy(model.SerializeToString(), "here", "wrong")


def test_missing_file_and_unknown_name(tmp_path):
    with pytest.raises(PolicyError, match="Cannot read"):
        load_controller(tmp_path / "none.onnx", ROBOT)
    with pytest.raises(UsageError, match=r"'energy-shaping'.*path/to/file\.py:CLASS"):
        load_controller("energy-shapin", ROBOT)
    (tmp_path / "weights.bin").write_bytes(b"PK")
    with pytest.raises(PolicyError, match=r"\.onnx or \.zip"):
        load_controller(tmp_path / "weights.bin", ROBOT)


def test_another_robot_is_named_and_another_rate_refused(file):
    other = dataclasses.replace(ROBOT, base=dataclasses.replace(ROBOT.base, mass=2.0))
    policy = load_controller(file, other)
    assert "mine was trained on robot 'legv2'" in policy.stranger(other, "mine")
    with pytest.raises(PolicyError, match="400 Hz"):
        load_controller(file, ROBOT, rate=400.0)


@pytest.mark.parametrize("command", [0.1, 0.5, np.nan])
@pytest.mark.parametrize("count", [1, 3])
def test_command_out_of_range_is_refused(command, count):
    seen, policy = measurement(count), Policy(made(), "memory", "test")
    seen.command[-1, 0] = command
    policy.reset(count)
    with pytest.raises(UsageError, match=r"0\.2 to 0\.4 m"):
        policy.act(seen)


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
