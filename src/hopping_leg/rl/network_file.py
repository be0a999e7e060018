"""Read a policy file's weights back: the inverse of ``export``."""

import numpy as np
import onnx
from onnx import numpy_helper

from hopping_leg.arrays import Array
from hopping_leg.controllers.policy import MEMORY
from hopping_leg.errors import PolicyError
from hopping_leg.rl.graph import ACTIVATIONS
from hopping_leg.rl.onnx_export import Network


def read_network(content: bytes) -> Network:
    """Return the actor in a policy file.

    Args:
        content: As ``export`` wrote it.

    Raises:
        PolicyError: The graph was made elsewhere, or remembers.
    """
    graph = onnx.load_from_string(content).graph
    if MEMORY in (given.name for given in graph.input):
        raise PolicyError("The policy remembers; only weights of one that does not can be read.")
    stored = {w.name: numpy_helper.to_array(w).astype(np.float64) for w in graph.initializer}
    hidden = {node.op_type for node in graph.node if node.output[0].startswith("hidden_")}
    names = {operator: name for name, operator in ACTIVATIONS.items()}
    count = sum(name.startswith("weight_") for name in stored)
    if not {"offset", "gain", "weight_0"} <= stored.keys() or len(hidden & names.keys()) != 1:
        raise PolicyError("The policy's graph has no dense layers as `hop train` writes them.")
    layers: list[tuple[Array, Array]] = [
        (stored[f"weight_{i}"].T.copy(), stored[f"bias_{i}"]) for i in range(count)
    ]
    squash = "tanh" if graph.node[-2].op_type == "Tanh" else "clip"
    bound = stored["most"].item() if "most" in stored else float("inf")
    return Network(stored["offset"], stored["gain"], layers, names[hidden.pop()], squash, bound)
