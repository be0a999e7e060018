import dataclasses
import itertools
import json
import logging

import numpy as np
import onnx
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from onnx import TensorProto, helper

from hopping_leg.controllers.policy import Card, Policy
from hopping_leg.controllers.registry import load_controller, load_policy
from hopping_leg.errors import PolicyError, UsageError
from hopping_leg.rl.onnx_export import Network, build_policy
from hopping_leg.robot import load_robot
from hopping_leg.sim.channel import Measurement
from tests.controllers.measurements import measurement
from tests.rl.test_onnx_export import made

ROBOT = load_robot("legv2-paper")
CARD = Card("test", "three-samples", 0.22, 0.4, (8.0, 6.0), ROBOT.name, ROBOT.digest, 200.0)


def network(activation="relu", squash="tanh", seed=0):
    rng = np.random.default_rng(seed)
    sizes = [15, 32, 16, 2]
    layers = [
        (rng.normal(size=(o, i)) / np.sqrt(i), rng.normal(size=o))
        for i, o in itertools.pairwise(sizes)
    ]
    return Network(rng.normal(size=15), rng.uniform(0.1, 2, 15), layers, activation, squash)


def loaded(net, count):
    policy = Policy(build_policy(net, CARD), "memory", "test")
    policy.reset(count)
    return policy


def by_hand(net, m):
    count = len(m.q)
    x = np.concatenate([m.q.reshape(count, 6), m.qd.reshape(count, 6), m.command], axis=1)
    x = (x - net.offset) * net.gain
    act = {
        "relu": lambda v: np.maximum(v, 0),
        "tanh": np.tanh,
        "elu": lambda v: np.where(v > 0, v, np.expm1(v)),
    }
    for weight, bias in net.layers[:-1]:
        x = act[net.activation](x @ weight.T + bias)
    x = x @ net.layers[-1][0].T + net.layers[-1][1]
    return (np.tanh(x) if net.squash == "tanh" else np.clip(x, -1, 1)) * CARD.torque_scale


@pytest.mark.parametrize("activation", ["relu", "tanh", "elu"])
@pytest.mark.parametrize("squash", ["tanh", "clip"])
def test_policy_computes_what_the_weights_say(activation, squash):
    net = network(activation, squash)
    torque = loaded(net, 7).act(measurement(7))
    assert torque.dtype == np.float64
    np.testing.assert_allclose(torque, by_hand(net, measurement(7)), atol=2e-5)


def test_card_survives_the_file_and_same_weights_give_the_same_bytes(tmp_path):
    path = tmp_path / "a.onnx"
    path.write_bytes(build_policy(network(), CARD))
    assert Policy.load(path).card == CARD
    assert Policy.load(path).name == "a"
    assert path.read_bytes() == build_policy(network(), CARD)


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
        ({"rate": None, "foo": 1}, "damaged"),
    ],
)
def test_wrong_metadata_is_refused(tmp_path, change, says):
    model = onnx.load_from_string(build_policy(network(), CARD))
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
    path.write_bytes(build_policy(network(), CARD))
    other = dataclasses.replace(ROBOT, base=dataclasses.replace(ROBOT.base, mass=2.0))
    with pytest.raises(PolicyError, match="trained on robot 'legv2-paper'"):
        load_controller(path, other, other="refuse")
    with caplog.at_level(logging.WARNING):
        load_controller(path, other)
    assert "trained on robot" in caplog.text
    caplog.clear()
    load_controller(path, other, other="accept")
    assert not caplog.text
    with pytest.raises(PolicyError, match="400 Hz"):
        load_policy(path).check_robot(ROBOT, 400.0)


def stream(ticks, seed):
    """Return measurements of four legs, some of them late."""
    rng = np.random.default_rng(seed)
    for _ in range(ticks):
        q, qd = rng.normal(size=(2, 4, 3, 2))
        age = np.sort(rng.permuted(np.tile(np.arange(10), (4, 1)), axis=1)[:, :3]) * 0.005
        yield Measurement(q, qd, rng.uniform(0.22, 0.4, (4, 3)), age)


@pytest.mark.parametrize("layout", ["three-samples", "dated"])
@settings(max_examples=10)
@given(
    rows=st.lists(st.integers(0, 3), unique=True, max_size=4),
    mask=st.booleans(),
    before=st.integers(0, 12),
    seed=st.integers(0, 99),
)
def test_a_forgotten_leg_acts_as_from_a_fresh_start_and_others_go_on(
    layout, rows, mask, before, seed
):
    told, untold, fresh = policies = [
        Policy(made(layout, remembers=True), "memory", "test") for _ in range(3)
    ]
    for policy in policies:
        policy.reset(4)
    seen = list(stream(before + 5, seed))
    for m in seen[:before]:
        untold.act(m)
        told.act(m)[:] = np.nan  # what it returned is the caller's
    forgotten = np.isin(np.arange(4), rows)
    told.reset(forgotten if mask else np.array(rows, int))
    for m in seen[before:]:
        as_told, as_fresh, as_untold = (p.act(m) for p in (told, fresh, untold))
        np.testing.assert_array_equal(as_told[forgotten], as_fresh[forgotten])
        np.testing.assert_array_equal(as_told[~forgotten], as_untold[~forgotten])


@pytest.mark.parametrize("command", [0.1, 0.5, np.nan])
@pytest.mark.parametrize("count", [1, 3])
def test_command_out_of_range_is_refused(command, count):
    m = measurement(count)
    m.command[-1, 0] = command
    with pytest.raises(UsageError, match=r"0\.22 to 0\.4 m"):
        loaded(network(), count).act(m)


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
