"""Policy files: ONNX graphs built from numpy weights.

Graph: inputs (flattened, joined) -> (x - offset) * gain -> dense layers -> squash -> full torque;
what remembers stands beside the inputs of the dense layers.
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
from hopping_leg.controllers.observation_history import FULL_TORQUE, make_observation_history
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
        """Put dense layers behind values, (n, in), all but the last activated; return theirs.

        The hidden ones are called ``hidden_0`` and so on, behind the prefix.
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


@dataclass(frozen=True)
class Correction:
    """The command is shifted until the network no longer guesses that hops miss it.

    With the guess e of how far the last hop missed the command that was shown, and the shift s,
    both in one unit, every update of the recurrent unit changes s by gain (e - s); the command that
    is shown is the one asked for less s.
    """

    of_hidden: Array
    """Weights of the guess on the last hidden layer, (1, width)."""
    bias: Array
    """(1,)."""
    gain: float
    most: float
    """Largest shift."""
    direction: Array
    """What a shift of the command adds to the normalised inputs, (size,)."""

    def show(self, graph: Graph, x: str, shift: str) -> str:
        """Return the inputs with the command shifted."""
        moved = graph.apply(
            "Mul", [shift, graph.constant("direction", self.direction)], "command_shift"
        )
        return graph.apply("Add", [x, moved], "shown")

    def update(self, graph: Graph, hidden: str, shift: str, due: str) -> str:
        """Return the next shift."""
        apply, constant = graph.apply, graph.constant
        names = [
            hidden,
            constant("guess_weight", self.of_hidden.T),
            constant("guess_bias", self.bias),
        ]
        missed = apply("Sub", [apply("Gemm", names, "guess"), shift], "still_missed")
        share = apply("Mul", [due, constant("correction_gain", self.gain)], "correction_share")
        moved = apply("Add", [shift, apply("Mul", [share, missed], "correction")], "corrected")
        return graph.clip(moved, -self.most, self.most, "next_shift", "shift_")


@dataclass(frozen=True)
class RecurrentUnit:
    """A gated recurrent unit with its gates reset, update and candidate in this order, as torch's.

    Weights are (3 k, size) and (3 k, k), biases (3 k,). It is updated ``every`` so many control
    periods, which the entry of the graph's memory behind its own counts; a correction's shift is
    the last one.
    """

    of_input: Array
    of_memory: Array
    bias_of_input: Array
    bias_of_memory: Array
    every: int = 1
    correction: Correction | None = None

    @property
    def size(self) -> int:
        """Entries of the graph's memory."""
        return int(self.of_memory.shape[1]) + 1 + (self.correction is not None)

    def build(self, graph: Graph, x: str) -> str:
        """Show the dense layers what is remembered and seen.

        ONNX orders gates update, reset, candidate.
        """

        def ordered(weights: Array) -> Array:
            reset, update, candidate = np.split(weights, 3)
            return np.concatenate([update, reset, candidate])[None]

        own = self.of_memory.shape[1]
        parts = ["remembered_before", "count", "shift"][: 2 + (self.correction is not None)]
        sizes = np.array([own, 1, 1][: len(parts)], np.int64)
        graph.add("Split", [MEMORY, graph.constant("memory_sizes", sizes)], parts, axis=1)
        if self.correction is not None:
            x = self.correction.show(graph, x, "shift")
        biases = np.concatenate([ordered(b)[0] for b in (self.bias_of_input, self.bias_of_memory)])
        first = graph.constant("first_axis", np.array([0], np.int64))
        graph.add("Unsqueeze", [x, first], ["sequence"])
        graph.add("Unsqueeze", ["remembered_before", first], ["memory_before"])
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
            hidden_size=own,
            linear_before_reset=1,
        )
        graph.add("Squeeze", ["memory_after", first], ["updated"])
        due = graph.clip(
            graph.apply("Sub", [graph.constant("one", 1.0), "count"], "not_due"),
            0.0,
            1.0,
            "due",
            "due_",
        )
        news = graph.apply("Sub", ["updated", "remembered_before"], "news")
        change = graph.apply("Mul", [due, news], "change")
        remembered = graph.apply("Add", ["remembered_before", change], "remembered")
        return graph.apply("Concat", [remembered, x], "remembered_and_seen", axis=1)

    def finish(self, graph: Graph, hidden: str) -> None:
        """Give the next memory, behind the dense layers' last hidden one."""
        apply = graph.apply
        last = apply("Sub", ["count", graph.constant("last", self.every - 2.0)], "since_last")
        round_over = graph.clip(last, 0.0, 1.0, "round_over", "round_")
        back = apply("Mul", [round_over, graph.constant("every", float(self.every))], "back")
        counted = apply("Sub", [apply("Add", ["count", "one"], "next_count"), back], "counted")
        parts = ["remembered", counted]
        if self.correction is not None:
            parts.append(self.correction.update(graph, hidden, "shift", "due"))
        apply("Concat", parts, NEXT_MEMORY, axis=1)


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
    """Memory beside the inputs of the dense layers."""

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
    layout = make_observation_history(card.layout, 1 / card.rate)
    graph, shapes = Graph(), layout.shapes
    apply, constant = graph.apply, graph.constant
    flat = [
        apply("Flatten", [n], f"{n}_flat", axis=1) if len(shapes[n]) > 1 else n
        for n in layout.network_inputs
    ]
    x = apply("Concat", flat, "joined", axis=1) if len(flat) > 1 else flat[0]
    x = apply("Sub", [x, constant("offset", network.offset)], "centred")
    x = apply("Mul", [x, constant("gain", network.gain)], "normalised")
    memory = network.memory
    if memory is not None:
        x = memory.build(graph, x)
    x = graph.dense(x, network.layers, network.activation)
    if memory is not None:
        memory.finish(graph, f"hidden_{len(network.layers) - 2}")
    bound = network.bound if network.squash == "tanh" else min(network.bound, 1.0)
    if np.isfinite(bound):
        x = graph.clip(x, -bound, bound, "bounded")
    if network.squash == "tanh":
        x = apply("Tanh", [x], "action")
    full = FULL_TORQUE if FULL_TORQUE in shapes else constant("torque_scale", card.torque_scale)
    apply("Mul", [x, full], "torque")
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
