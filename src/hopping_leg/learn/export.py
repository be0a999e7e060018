"""Write a policy file: an ONNX graph built from numpy weights.

Graph: inputs (flattened, joined) -> (x - offset) * gain -> dense layers -> squash -> torque scale;
a recurrent network remembers before the dense layers.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from hopping_leg.arrays import Array
from hopping_leg.control.layouts import make_layout
from hopping_leg.control.policy import MEMORY, METADATA_KEY, NEXT_MEMORY, Card
from hopping_leg.errors import UsageError
from hopping_leg.trace import write_atomically

ACTIVATIONS = {"relu": "Relu", "tanh": "Tanh", "elu": "Elu"}
"""Activation of the hidden layers, to its ONNX operator."""

SQUASHES = ("tanh", "clip")
"""How the last layer's output is brought to -1..1."""

_OPSET = 17
_IR_VERSION = 8


@dataclass(frozen=True)
class RecurrentUnit:
    """A gated recurrent unit with its gates reset, update and candidate in this order, as torch's.

    Attributes:
        of_input: (3 k, size).
        of_memory: (3 k, k).
        bias_of_input: (3 k,).
        bias_of_memory: (3 k,).
    """

    of_input: Array
    of_memory: Array
    bias_of_input: Array
    bias_of_memory: Array

    @property
    def memory(self) -> int:
        """Entries k of its memory."""
        return int(self.of_memory.shape[1])


@dataclass(frozen=True)
class Network:
    """A deterministic actor in numpy.

    Attributes:
        offset: Subtracted from the joined inputs, (size,).
        gain: Multiplied with the rest, (size,).
        layers: Weight (out, in) and bias (out,) of every dense layer.
        activation: Of the hidden layers, one of ``ACTIVATIONS``.
        squash: Of the output, one of ``SQUASHES``.
        bound: The last layer's output is clipped to +-bound before the squash.
        unit: What remembers, in front of the dense layers.
    """

    offset: Array
    gain: Array
    layers: Sequence[tuple[Array, Array]]
    activation: str
    squash: str
    bound: float = float("inf")
    unit: RecurrentUnit | None = None

    def __post_init__(self) -> None:
        if self.activation not in ACTIVATIONS or self.squash not in SQUASHES:
            raise UsageError(
                f"Activation '{self.activation}' with squash '{self.squash}' cannot be exported;"
                f" valid: {', '.join(ACTIVATIONS)} with {' or '.join(SQUASHES)}."
            )


def build_policy(network: Network, card: Card) -> bytes:
    """Return a policy file's content.

    Args:
        network: The actor; its input is the layout's arrays, flattened row by row and joined.
        card: Stored in the metadata.
    """
    shapes = make_layout(card.layout, 1 / card.rate).shapes
    nodes: list[Any] = []
    weights: list[Any] = []

    def constant(name: str, value: Array) -> str:
        kind = value.dtype if value.dtype == np.int64 else np.float32
        weights.append(numpy_helper.from_array(np.ascontiguousarray(value, kind), name))
        return name

    def apply(operator: str, inputs: list[str], output: str, **attributes: float) -> str:
        nodes.append(helper.make_node(operator, inputs, [output], name=output, **attributes))
        return output

    flat = [
        apply("Flatten", [n], f"{n}_flat", axis=1) if len(s) > 1 else n for n, s in shapes.items()
    ]
    x = apply("Concat", flat, "joined", axis=1) if len(flat) > 1 else flat[0]
    x = apply("Sub", [x, constant("offset", network.offset)], "centred")
    x = apply("Mul", [x, constant("gain", network.gain)], "normalised")
    unit = network.unit
    if unit is not None:
        x = _remember(unit, x, nodes, constant)
    for index, (weight, bias) in enumerate(network.layers):
        names = [x, constant(f"weight_{index}", weight.T), constant(f"bias_{index}", bias)]
        x = apply("Gemm", names, f"dense_{index}")
        if index < len(network.layers) - 1:
            x = apply(ACTIVATIONS[network.activation], [x], f"hidden_{index}")
    bound = network.bound if network.squash == "tanh" else min(network.bound, 1.0)
    if np.isfinite(bound):
        bounds = [constant("least", np.array(-bound)), constant("most", np.array(bound))]
        x = apply("Clip", [x, *bounds], "bounded")
    if network.squash == "tanh":
        x = apply("Tanh", [x], "action")
    apply("Mul", [x, constant("torque_scale", np.array(card.torque_scale))], "torque")
    inputs = [_array(name, *shape) for name, shape in shapes.items()]
    outputs = [_array("torque", 2)]
    if unit is not None:
        inputs.append(_array(MEMORY, unit.memory))
        outputs.append(_array(NEXT_MEMORY, unit.memory))
    graph = helper.make_graph(nodes, "policy", inputs, outputs, weights)
    model = helper.make_model(
        graph, opset_imports=[helper.make_opsetid("", _OPSET)], producer_name="hopping-leg"
    )
    model.ir_version = _IR_VERSION
    helper.set_model_props(model, {METADATA_KEY: card.to_json()})
    onnx.checker.check_model(model, full_check=True)
    content: bytes = model.SerializeToString(deterministic=True)
    return content


def _remember(
    unit: RecurrentUnit, x: str, nodes: list[Any], constant: Callable[[str, Array], str]
) -> str:
    """Put a recurrent unit behind values; return what it gives.

    ONNX wants a sequence, here of one tick, and the gates in the order update, reset, candidate.
    """

    def ordered(weights: Array) -> Array:
        reset, update, candidate = np.split(weights, 3)
        return np.concatenate([update, reset, candidate])[None]

    biases = np.concatenate([ordered(b)[0] for b in (unit.bias_of_input, unit.bias_of_memory)])
    first = constant("first_axis", np.array([0], np.int64))
    nodes += [
        helper.make_node("Unsqueeze", [x, first], ["sequence"]),
        helper.make_node("Unsqueeze", [MEMORY, first], ["memory_before"]),
        helper.make_node(
            "GRU",
            [
                "sequence",
                constant("gru_of_input", ordered(unit.of_input)),
                constant("gru_of_memory", ordered(unit.of_memory)),
                constant("gru_bias", biases[None]),
                "",
                "memory_before",
            ],
            ["", "memory_after"],
            hidden_size=unit.memory,
            linear_before_reset=1,
        ),
        helper.make_node("Squeeze", ["memory_after", first], [NEXT_MEMORY]),
    ]
    return NEXT_MEMORY


def _array(name: str, *shape: int) -> Any:  # noqa: ANN401
    return helper.make_tensor_value_info(name, TensorProto.FLOAT, ["n", *shape])


def save_policy(path: Path, network: Network, card: Card) -> None:
    """Write a policy file; an existing one is replaced only once the new one is complete."""
    write_atomically(path, build_policy(network, card))
