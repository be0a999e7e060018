"""An ONNX graph under construction, layer by layer."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from onnx import TensorProto, helper, numpy_helper

from hopping_leg.arrays import Array

ACTIVATIONS = {"relu": "Relu", "tanh": "Tanh", "elu": "Elu"}
"""Activation of hidden layers, to its ONNX operator."""

Layers = Sequence[tuple[Array, Array]]
"""Weight (out, in) and bias (out,) of every dense layer."""


class Graph:
    """Nodes and weights in the order in which they are made.

    Attributes:
        nodes: Of the graph.
        weights: Its initializers.
    """

    def __init__(self) -> None:
        self.nodes: list[Any] = []
        self.weights: list[Any] = []

    def constant(self, name: str, value: npt.ArrayLike) -> str:
        """Store numbers, in single precision unless they are integers; return their name."""
        array = np.asarray(value)
        kind = array.dtype if array.dtype == np.int64 else np.float32
        self.weights.append(numpy_helper.from_array(np.ascontiguousarray(array, kind), name))
        return name

    def apply(self, operator: str, inputs: Sequence[str], output: str, **attributes: float) -> str:
        """Add a node with one output; return its name."""
        self.add(operator, inputs, [output], name=output, **attributes)
        return output

    def add(
        self,
        operator: str,
        inputs: Sequence[str],
        outputs: Sequence[str],
        **attributes: Any,  # noqa: ANN401
    ) -> None:
        """Add any node."""
        self.nodes.append(helper.make_node(operator, inputs, outputs, **attributes))

    def dense(self, x: str, layers: Layers, activation: str, prefix: str = "") -> str:
        """Put dense layers behind values; return what the last one gives.

        Args:
            x: Values, (n, in).
            layers: Of which all but the last have the activation.
            activation: One of ``ACTIVATIONS``.
            prefix: Of all names.
        """
        for index, (weight, bias) in enumerate(layers):
            names = [
                x,
                self.constant(f"{prefix}weight_{index}", weight.T),
                self.constant(f"{prefix}bias_{index}", bias),
            ]
            x = self.apply("Gemm", names, f"{prefix}dense_{index}")
            if index < len(layers) - 1:
                x = self.apply(ACTIVATIONS[activation], [x], f"{prefix}hidden_{index}")
        return x

    def clip(self, x: str, least: float, most: float, output: str, prefix: str = "") -> str:
        """Bound values; return their name. The bounds' names begin with the prefix."""
        bounds = [self.constant(f"{prefix}least", least), self.constant(f"{prefix}most", most)]
        return self.apply("Clip", [x, *bounds], output)


def array_info(name: str, *shape: int) -> Any:  # noqa: ANN401
    """Describe an input or output of the graph, (n, ...)."""
    return helper.make_tensor_value_info(name, TensorProto.FLOAT, ["n", *shape])
