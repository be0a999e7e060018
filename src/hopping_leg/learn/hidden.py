"""A policy file whose graph also gives what its hidden layers do."""

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from hopping_leg.control.policy import MEMORY
from hopping_leg.errors import PolicyError

PREFIX = "hidden_"
"""Of the names that ``export`` gives to hidden layers."""


def expose_hidden(content: bytes, shuffle: int | None = None) -> bytes:
    """Return a policy's graph with its hidden layers as further outputs, in order.

    Args:
        content: The policy file.
        shuffle: Seed with which the entries of every hidden layer's weights and biases change
            places: a network of the same size and sizes of weights that has learnt nothing.

    Raises:
        PolicyError: The graph names no hidden layer, or remembers.
    """
    model = onnx.load_from_string(content)
    graph = model.graph
    if MEMORY in (given.name for given in graph.input):
        raise PolicyError(
            "The hidden layers of a policy that remembers depend on more than a tick's measurements"
            " and cannot be read out one by one; name a policy without a memory."
        )
    names = [name for node in graph.node for name in node.output if name.startswith(PREFIX)]
    if not names:
        raise PolicyError("The policy's graph names no hidden layer; export it with `hop train`.")
    if shuffle is not None:
        rng = np.random.default_rng(shuffle)
        hidden = {i for node in graph.node[: _last(graph, names)] for i in node.input}
        for stored in graph.initializer:
            if stored.name in hidden and stored.name.startswith(("weight_", "bias_")):
                values = numpy_helper.to_array(stored)
                mixed = rng.permutation(values.ravel()).reshape(values.shape)
                stored.CopyFrom(numpy_helper.from_array(mixed, stored.name))
    for name in names:
        graph.output.append(helper.make_tensor_value_info(name, TensorProto.FLOAT, ["n", None]))
    extended: bytes = model.SerializeToString(deterministic=True)
    return extended


def _last(graph: onnx.GraphProto, names: list[str]) -> int:
    """Return the number of nodes up to the last hidden layer."""
    return max(i for i, node in enumerate(graph.node) if names[-1] in node.output) + 1
