"""Policy files: ONNX graphs built from numpy weights.

Graph: inputs (flattened, joined) -> (x - offset) * gain -> dense layers -> squash -> torque scale;
what remembers stands before the dense layers.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import onnx
from onnx import TensorProto, helper, numpy_helper

from hopping_leg import errors
from hopping_leg.arrays import Array
from hopping_leg.controllers.observation_history import make_observation_history
from hopping_leg.controllers.policy import MEMORY, METADATA_KEY, NEXT_MEMORY, Card

ACTIVATIONS = {"relu": "Relu", "tanh": "Tanh", "elu": "Elu"}
"""Activation of hidden layers, to its ONNX operator."""

Layers = Sequence[tuple[Array, Array]]
"""Weight (out, in) and bias (out,) of every dense layer."""


class Graph:
    """Nodes and weights, the graph's initializers, in the order in which they are made."""

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
        """Put dense layers behind values, (n, in), all but the last activated; return theirs."""
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


@dataclass(frozen=True)
class RecurrentUnit:
    """A gated recurrent unit with its gates reset, update and candidate in this order, as torch's.

    Weights are (3 k, size) and (3 k, k), biases (3 k,).
    """

    of_input: Array
    of_memory: Array
    bias_of_input: Array
    bias_of_memory: Array

    @property
    def size(self) -> int:
        """Entries k of its memory."""
        return int(self.of_memory.shape[1])

    def build(self, graph: Graph, x: str) -> str:
        """Show the dense layers what is remembered; ONNX orders gates update, reset, candidate."""

        def ordered(weights: Array) -> Array:
            reset, update, candidate = np.split(weights, 3)
            return np.concatenate([update, reset, candidate])[None]

        biases = np.concatenate([ordered(b)[0] for b in (self.bias_of_input, self.bias_of_memory)])
        first = graph.constant("first_axis", np.array([0], np.int64))
        graph.add("Unsqueeze", [x, first], ["sequence"])
        graph.add("Unsqueeze", [MEMORY, first], ["memory_before"])
        graph.add(
            "GRU",
            [
                "sequence",
                graph.constant("gru_of_input", ordered(self.of_input)),
                graph.constant("gru_of_memory", ordered(self.of_memory)),
                graph.constant("gru_bias", biases[None]),
                "",
                "memory_before",
            ],
            ["", "memory_after"],
            hidden_size=self.size,
            linear_before_reset=1,
        )
        graph.add("Squeeze", ["memory_after", first], [NEXT_MEMORY])
        return NEXT_MEMORY


@dataclass(frozen=True)
class CommandMap:
    """Correction of the command, linear between heights and constant beyond them."""

    heights: tuple[float, ...]
    """Rising, m."""
    shifts: tuple[float, ...]
    """What is added to the command at these heights, m."""


SQUASHES = ("tanh", "clip")
"""How the last layer's output is brought to -1..1."""

_OPSET = 17
_IR_VERSION = 8


@dataclass(frozen=True)
class Network:
    """A deterministic actor in numpy."""

    offset: Array
    """Offset that is subtracted from the joined inputs, (size,)."""
    gain: Array
    """Factor of the rest, (size,)."""
    layers: Layers
    """Weight (out, in) and bias (out,) of every dense layer."""
    activation: str
    """Activation of the hidden layers, one of ``ACTIVATIONS``."""
    squash: str
    """Squash of the output, one of ``SQUASHES``."""
    bound: float = float("inf")
    """Bound of the last layer's output before the squash."""
    memory: RecurrentUnit | None = None
    """Memory in front of the dense layers."""

    def __post_init__(self) -> None:
        if self.activation not in ACTIVATIONS or self.squash not in SQUASHES:
            raise errors.UsageError(
                f"Activation '{self.activation}' with squash '{self.squash}' cannot be exported;"
                f" valid: {', '.join(ACTIVATIONS)} with {' or '.join(SQUASHES)}."
            )


def build_policy(network: Network, card: Card) -> bytes:
    """Return a policy file's content, with the card in its metadata.

    The actor's input is the layout's arrays, flattened row by row and joined.
    """
    shapes = make_observation_history(card.layout, 1 / card.rate).shapes
    graph = Graph()
    apply, constant = graph.apply, graph.constant
    flat = [
        apply("Flatten", [n], f"{n}_flat", axis=1) if len(s) > 1 else n for n, s in shapes.items()
    ]
    x = apply("Concat", flat, "joined", axis=1) if len(flat) > 1 else flat[0]
    x = apply("Sub", [x, constant("offset", network.offset)], "centred")
    x = apply("Mul", [x, constant("gain", network.gain)], "normalised")
    memory = network.memory
    if memory is not None:
        x = memory.build(graph, x)
    x = graph.dense(x, network.layers, network.activation)
    bound = network.bound if network.squash == "tanh" else min(network.bound, 1.0)
    if np.isfinite(bound):
        x = graph.clip(x, -bound, bound, "bounded")
    if network.squash == "tanh":
        x = apply("Tanh", [x], "action")
    apply("Mul", [x, constant("torque_scale", card.torque_scale)], "torque")
    inputs = [array_info(name, *shape) for name, shape in shapes.items()]
    outputs = [array_info("torque", 2)]
    if memory is not None:
        inputs.append(array_info(MEMORY, memory.size))
        outputs.append(array_info(NEXT_MEMORY, memory.size))
    made = helper.make_graph(graph.nodes, "policy", inputs, outputs, graph.weights)
    model = helper.make_model(
        made, opset_imports=[helper.make_opsetid("", _OPSET)], producer_name="hopping-leg"
    )
    model.ir_version = _IR_VERSION
    helper.set_model_props(model, {METADATA_KEY: card.to_json()})
    onnx.checker.check_model(model, full_check=True)
    content: bytes = model.SerializeToString(deterministic=True)
    return content


def with_card(content: bytes, card: Card) -> bytes:
    """Return a policy file with another card."""
    model = onnx.load_from_string(content)
    helper.set_model_props(model, {METADATA_KEY: card.to_json()})
    carded: bytes = model.SerializeToString(deterministic=True)
    return carded


def with_command_map(content: bytes, correction: CommandMap) -> bytes:
    """Return a policy file whose command is corrected before anything else.

    The shift is the first one and, for every height h, the change of its slope there times
    max(command - h, 0).
    """
    heights, shifts = np.array(correction.heights), np.array(correction.shifts)
    slopes = np.concatenate([[0.0], np.diff(shifts) / np.diff(heights), [0.0]])
    model = onnx.load_from_string(content)
    inner, graph = model.graph, Graph()
    prefix = f"map_{sum(node.op_type == 'Unsqueeze' for node in inner.node)}_"
    apply, constant = graph.apply, graph.constant
    last = constant(f"{prefix}axis", np.array([-1], np.int64))
    each = apply("Unsqueeze", ["command", last], f"{prefix}each")
    above = apply("Sub", [each, constant(f"{prefix}heights", heights)], f"{prefix}above")
    bends = constant(f"{prefix}bends", np.diff(slopes)[:, None])
    bent = apply("MatMul", [apply("Relu", [above], f"{prefix}ramps"), bends], f"{prefix}bent")
    shift = apply("Squeeze", [bent, last], f"{prefix}shift")
    first = apply("Add", ["command", constant(f"{prefix}first", shifts[0])], f"{prefix}first_shift")
    corrected = apply("Add", [first, shift], f"{prefix}command")
    for node in inner.node:
        node.input[:] = [corrected if name == "command" else name for name in node.input]
    nodes = [*graph.nodes, *inner.node]
    del inner.node[:]
    inner.node.extend(nodes)
    inner.initializer.extend(graph.weights)
    onnx.checker.check_model(model, full_check=True)
    mapped: bytes = model.SerializeToString(deterministic=True)
    return mapped
