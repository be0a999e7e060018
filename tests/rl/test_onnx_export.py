"""Hidden layers come out as they are computed; shuffling leaves nothing but their size."""

import dataclasses

import numpy as np
import onnxruntime
import pytest

from hopping_leg.controllers.policy import Policy
from hopping_leg.controllers.registry import load_policy, shipped_policies
from hopping_leg.errors import PolicyError
from hopping_leg.rl.onnx_export import (
    Network,
    RecurrentUnit,
    build_policy,
    expose_hidden,
    read_network,
)

POLICY = load_policy("fast")


def outputs(graph, feeds):
    session = onnxruntime.InferenceSession(graph, providers=["CPUExecutionProvider"])
    names = [output.name for output in session.get_outputs()]
    return dict(zip(names, session.run(names, feeds), strict=True))


@pytest.fixture(scope="module")
def feeds():
    rng = np.random.default_rng(0)
    return {
        name: rng.normal(size=(6, *shape)).astype(np.float32)
        for name, shape in POLICY.inputs.items()
    }


def test_hidden_layers_follow_the_torque(feeds):
    plain, extended = outputs(POLICY.content, feeds), outputs(expose_hidden(POLICY.content), feeds)
    assert next(iter(extended)) == "torque"
    hidden = list(extended)[1:]
    assert hidden == [f"hidden_{i}" for i in range(len(hidden))]
    assert len(hidden) >= 2
    np.testing.assert_array_equal(plain["torque"], extended["torque"])
    assert all(np.abs(extended[name]).max() < 1.001 for name in hidden)


def test_shuffled_layers_keep_their_size_and_forget_their_function(feeds):
    own = outputs(expose_hidden(POLICY.content), feeds)
    mixed = outputs(expose_hidden(POLICY.content, 1), feeds)
    assert {name: value.shape for name, value in own.items()} == {
        name: value.shape for name, value in mixed.items()
    }
    assert np.abs(own["hidden_1"] - mixed["hidden_1"]).max() > 0.1
    assert expose_hidden(POLICY.content, 1) == expose_hidden(POLICY.content, 1)
    assert expose_hidden(POLICY.content, 1) != expose_hidden(POLICY.content, 2)


def test_a_network_without_hidden_layers_is_refused():
    size = sum(int(np.prod(shape)) for shape in POLICY.inputs.values())
    network = Network(
        np.zeros(size), np.ones(size), [(np.zeros((2, size)), np.zeros(2))], "tanh", "tanh"
    )
    with pytest.raises(PolicyError, match="no hidden layer"):
        expose_hidden(build_policy(network, POLICY.card))


def remembering():
    card = dataclasses.replace(POLICY.card, layout="three-samples")
    rng = np.random.default_rng(0)
    unit = RecurrentUnit(*(rng.normal(size=shape) for shape in ((12, 15), (12, 4), 12, 12)))
    layers = [(rng.normal(size=(2, 4)), np.zeros(2))]
    network = Network(np.zeros(15), np.ones(15), layers, "tanh", "clip", memory=unit)
    return Policy(build_policy(network, card), "here", "remembering")


def test_a_policy_that_remembers_needs_no_hidden_layer_and_is_shuffled_whole():
    policy = remembering()
    rng = np.random.default_rng(1)
    feeds = {n: rng.normal(size=(3, *s)).astype(np.float32) for n, s in policy.inputs.items()}
    feeds["memory"] = rng.normal(size=(3, 4)).astype(np.float32)
    plain = outputs(policy.content, feeds)
    own, mixed = (outputs(expose_hidden(policy.content, seed), feeds) for seed in (None, 1))
    np.testing.assert_array_equal(own["next_memory"], plain["next_memory"])
    assert np.abs(own["next_memory"] - mixed["next_memory"]).max() > 0.01


@pytest.mark.parametrize("name", shipped_policies())
def test_a_policy_written_again_has_the_same_bytes_or_is_refused_for_its_memory(name):
    policy = load_policy(name)
    if policy.remembers:
        with pytest.raises(PolicyError, match="remembers"):
            read_network(policy.content)
        return
    assert build_policy(read_network(policy.content), policy.card) == policy.content


def test_a_foreign_graph_is_refused():
    import onnx
    from onnx import helper

    node = helper.make_node("Identity", ["x"], ["y"])
    value = [helper.make_tensor_value_info(n, onnx.TensorProto.FLOAT, ["n"]) for n in "xy"]
    model = helper.make_model(helper.make_graph([node], "g", value[:1], value[1:]))
    with pytest.raises(PolicyError, match="dense layers"):
        read_network(model.SerializeToString())
