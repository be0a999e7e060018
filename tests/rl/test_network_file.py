"""A policy file's weights read back are those that were written."""

import dataclasses

import numpy as np
import pytest

from hopping_leg.controllers.registry import load_policy, shipped_policies
from hopping_leg.errors import PolicyError
from hopping_leg.rl.network_file import read_network
from hopping_leg.rl.onnx_export import build_policy


@pytest.mark.parametrize("name", shipped_policies())
def test_a_policy_written_again_has_the_same_bytes_or_is_refused_for_its_memory(name):
    policy = load_policy(name)
    if policy.remembers:
        with pytest.raises(PolicyError, match="remembers"):
            read_network(policy.content)
        return
    assert build_policy(read_network(policy.content), policy.card) == policy.content


def test_a_changed_weight_changes_the_file():
    policy = load_policy("fast")
    network = read_network(policy.content)
    weight, bias = network.layers[-1]
    changed = dataclasses.replace(network, layers=[*network.layers[:-1], (weight, bias + 0.1)])
    again = read_network(build_policy(changed, policy.card))
    np.testing.assert_allclose(again.layers[-1][1] - bias, 0.1, atol=1e-6)


def test_a_foreign_graph_is_refused():
    import onnx
    from onnx import helper

    node = helper.make_node("Identity", ["x"], ["y"])
    value = [helper.make_tensor_value_info(n, onnx.TensorProto.FLOAT, ["n"]) for n in "xy"]
    model = helper.make_model(helper.make_graph([node], "g", value[:1], value[1:]))
    with pytest.raises(PolicyError, match="dense layers"):
        read_network(model.SerializeToString())
