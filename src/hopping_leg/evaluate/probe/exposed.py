"""A policy that hops as ever while everything its network sees and computes is kept."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import onnxruntime

from hopping_leg.arrays import Array
from hopping_leg.control import Setup, roll_out
from hopping_leg.control.layouts import Inputs, make_layout
from hopping_leg.control.policy import Policy
from hopping_leg.control.protocol import Measurement
from hopping_leg.evaluate.metrics import START_SECONDS

OBSERVATION = "observation"
"""Name of what the network sees."""


@dataclass(frozen=True)
class Recording:
    """What n hopping legs saw, computed and truly did after the start.

    Attributes:
        features: Name to values, (ticks, n, size).
        truth: Trace column to values, (ticks, n).
        rate: Control rate, Hz.
    """

    features: dict[str, Array]
    truth: dict[str, Array]
    rate: float


class Exposed:
    """Acts as a policy does; implements ``Controller``.

    Args:
        policy: Whose card and layout.
        graph: Its graph with hidden layers as outputs.
    """

    def __init__(self, policy: Policy, graph: bytes) -> None:
        self.name, self._policy = policy.name, policy
        self._layout = make_layout(policy.card.layout, 1 / policy.card.rate)
        self._session = open_graph(graph)
        self.seen: list[Inputs] = []

    def reset(self, count: int) -> None:
        """Forget everything."""
        self._layout.reset(count)
        self._torque = np.zeros((count, 2))
        self.seen = []

    def act(self, measurement: Measurement) -> Array:
        """Return joint torques, N m, (n, 2)."""
        self._layout.update(measurement, self._torque)
        inputs = {name: np.array(values) for name, values in self._layout.inputs().items()}
        self.seen.append(inputs)
        self._torque = self._session.run(["torque"], inputs)[0].astype(np.float64)
        return self._torque

    def internals(self) -> dict[str, Array]:
        """Return nothing else worth recording."""
        return {}


def record(
    policy: Policy,
    graphs: dict[str, bytes],
    setup: Setup,
    commands: Array,
    seed: int,
) -> Recording:
    """Let a policy hop; return what its network saw and computed.

    Args:
        policy: The policy.
        graphs: Suffix of the names of hidden layers to a graph with them as outputs; the graph of
            the suffix ``""`` acts.
        setup: The world.
        commands: Desired heights, m, (ticks, n).
        seed: Of noise and delay.
    """
    controller = Exposed(policy, graphs[""])
    run = roll_out(controller, setup, commands, seed)
    first = round(START_SECONDS * setup.rate)
    seen = controller.seen[first:]
    shape = (len(seen), commands.shape[1], -1)
    stacked = {
        name: np.concatenate([inputs[name] for inputs in seen]) for name in controller.seen[0]
    }
    flat = [values.reshape(len(values), -1) for values in stacked.values()]
    features = {OBSERVATION: np.concatenate(flat, axis=1).reshape(shape)}
    for suffix, graph in graphs.items():
        session = open_graph(graph)
        names = [output.name for output in session.get_outputs()][1:]
        for name, values in zip(names, session.run(names, stacked), strict=True):
            features[name + suffix] = values.reshape(shape)
    return Recording(features, {k: v[first:] for k, v in run.data.items()}, setup.rate)


def open_graph(content: bytes) -> Any:  # noqa: ANN401
    """Return an onnxruntime session on one thread."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    return onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
