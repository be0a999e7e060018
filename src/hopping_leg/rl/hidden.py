"""A policy file whose graph also gives what its hidden layers do."""

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from hopping_leg.controllers.policy import NEXT_MEMORY
from hopping_leg.errors import PolicyError

PREFIX = "hidden_"
"""Of the names that ``export`` gives to hidden layers."""

_LEARNT = ("weight_", "bias_", "gru_", "felt_weight_", "felt_bias_")
"""Beginnings of the names that ``export`` and ``memories`` give to what is learnt."""


def expose_hidden(content: bytes, shuffle: int | None = None) -> bytes:
    """Return a policy's graph with its hidden layers as further outputs, in order.

    Args:
        content: The policy file.
        shuffle: Seed with which the entries of weights and biases change places, of every hidden
            layer and of what fills the memory: a network of the same size and sizes of weights that
            has learnt nothing.

    Raises:
        PolicyError: The graph names no hidden layer and remembers nothing.
    """
    model = onnx.load_from_string(content)
    graph = model.graph
    names = [name for node in graph.node for name in node.output if name.startswith(PREFIX)]
    inside = [*names, *(given.name for given in graph.output if given.name == NEXT_MEMORY)]
    if not inside:
        raise PolicyError("The policy's graph names no hidden layer; export it with `hop train`.")
    if shuffle is not None:
        rng = np.random.default_rng(shuffle)
        hidden = {i for node in graph.node[: _last(graph, inside)] for i in node.input}
        for stored in graph.initializer:
            if stored.name in hidden and stored.name.startswith(_LEARNT):
                values = numpy_helper.to_array(stored)
                mixed = rng.permutation(values.ravel()).reshape(values.shape)
                stored.CopyFrom(numpy_helper.from_array(mixed, stored.name))
    for name in names:
        graph.output.append(helper.make_tensor_value_info(name, TensorProto.FLOAT, ["n", None]))
    extended: bytes = model.SerializeToString(deterministic=True)
    return extended


def _last(graph: onnx.GraphProto, names: list[str]) -> int:
    """Return the number of nodes up to the last that gives one of these values."""
    return max(i for i, node in enumerate(graph.node) if set(names) & set(node.output)) + 1
