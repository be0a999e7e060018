"""Write a policy file: an ONNX graph built from numpy weights.

Graph: inputs (flattened, joined) -> (x - offset) * gain -> dense layers -> squash -> torque scale;
what remembers stands before the dense layers.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import onnx
from onnx import helper

from hopping_leg.arrays import Array
from hopping_leg.controllers.observation_history import make_observation_history
from hopping_leg.controllers.policy import MEMORY, METADATA_KEY, NEXT_MEMORY, Card
from hopping_leg.errors import UsageError
from hopping_leg.io import write_atomically
from hopping_leg.rl.graph import ACTIVATIONS, Graph, Layers, array_info
from hopping_leg.rl.memories import Memory

SQUASHES = ("tanh", "clip")
"""How the last layer's output is brought to -1..1."""

_OPSET = 17
_IR_VERSION = 8


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
        memory: What remembers, in front of the dense layers.
    """

    offset: Array
    gain: Array
    layers: Layers
    activation: str
    squash: str
    bound: float = float("inf")
    memory: Memory | None = None

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
        x = memory.build(graph, x, len(network.offset))
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


def save_policy(path: Path, network: Network, card: Card) -> None:
    """Write a policy file; an existing one is replaced only once the new one is complete."""
    write_atomically(path, build_policy(network, card))
