"""A policy that hops as ever while everything its network sees and computes is kept."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import onnxruntime

from hopping_leg.arrays import Array
from hopping_leg.controllers import RolloutConfig, rollout
from hopping_leg.controllers.observation_history import Inputs, make_observation_history
from hopping_leg.controllers.policy import MEMORY, NEXT_MEMORY, Policy
from hopping_leg.controllers.protocol import Measurement
from hopping_leg.evaluate.metrics import START_SECONDS

OBSERVATION = "observation"
"""Name of what the network sees."""

REMEMBERED = "memory"
"""Name of what it remembers after a tick."""


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


class Graph:
    """A policy's graph, run tick by tick with a memory of its own.

    Args:
        content: With hidden layers as outputs, see ``learn.hidden``.
    """

    def __init__(self, content: bytes) -> None:
        self._session = _open(content)
        self._outputs = [output.name for output in self._session.get_outputs()]
        shapes = {i.name: i.shape for i in self._session.get_inputs()}
        self._size = shapes[MEMORY][1] if MEMORY in shapes else 0

    def reset(self, count: int) -> None:
        """Forget everything; n is ``count`` from now on."""
        self._memory = np.zeros((count, self._size), np.float32)

    def run(self, inputs: Inputs) -> dict[str, npt.NDArray[np.float32]]:
        """Return the torque, N m, what is remembered, and every hidden layer, (n, size) each."""
        fed = {**inputs, MEMORY: self._memory} if self._size else inputs
        given = dict(zip(self._outputs, self._session.run(None, fed), strict=True))
        if self._size:
            self._memory = given.pop(NEXT_MEMORY)
            given[REMEMBERED] = self._memory
        return given


class Exposed:
    """Acts as a policy does; implements ``Controller``.

    Args:
        policy: Whose card and layout.
        graph: Its graph with hidden layers as outputs.
    """

    def __init__(self, policy: Policy, graph: bytes) -> None:
        self.name, self._policy = policy.name, policy
        self._layout = make_observation_history(policy.card.layout, 1 / policy.card.rate)
        self._graph = Graph(graph)
        self.seen: list[Inputs] = []
        self.given: list[dict[str, npt.NDArray[np.float32]]] = []

    def reset(self, count: int) -> None:
        """Forget everything."""
        self._layout.reset(count)
        self._graph.reset(count)
        self._torque = np.zeros((count, 2))
        self.seen, self.given = [], []

    def act(self, measurement: Measurement) -> Array:
        """Return joint torques, N m, (n, 2)."""
        self._layout.update(measurement, self._torque)
        inputs = {name: np.array(values) for name, values in self._layout.inputs().items()}
        self.seen.append(inputs)
        self.given.append(self._graph.run(inputs))
        self._torque = self.given[-1]["torque"].astype(np.float64)
        return self._torque

    def internals(self) -> dict[str, Array]:
        """Return nothing else worth recording."""
        return {}


def record(
    policy: Policy,
    graphs: dict[str, bytes],
    setup: RolloutConfig,
    commands: Array,
    seed: int,
) -> Recording:
    """Let a policy hop; return what its network saw, remembered and computed.

    Args:
        policy: The policy.
        graphs: Suffix of the names of hidden layers to a graph with them as outputs; the graph of
            the suffix ``""`` acts, the others are shown what it saw.
        setup: The world.
        commands: Desired heights, m, (ticks, n).
        seed: Of noise and delay.
    """
    controller = Exposed(policy, graphs[""])
    run = rollout(controller, setup, commands, seed)
    seen, count = controller.seen, commands.shape[1]
    first = round(START_SECONDS * setup.rate)
    flat = [[v.reshape(count, -1) for v in inputs.values()] for inputs in seen[first:]]
    features = {OBSERVATION: np.stack([np.concatenate(tick, axis=1) for tick in flat])}
    for suffix, content in graphs.items():
        given = (_shown(Graph(content), seen, count) if suffix else controller.given)[first:]
        features |= {
            name + suffix: np.stack([tick[name] for tick in given])
            for name in given[0]
            if name != "torque"
        }
    exact = {name: values.astype(np.float64) for name, values in features.items()}
    return Recording(exact, {k: v[first:] for k, v in run.data.items()}, setup.rate)


def _shown(
    graph: Graph, seen: list[Inputs], count: int
) -> list[dict[str, npt.NDArray[np.float32]]]:
    """Return what a graph computes where n legs show it what another saw, tick by tick."""
    graph.reset(count)
    return [graph.run(inputs) for inputs in seen]


def _open(content: bytes) -> Any:  # noqa: ANN401
    """Return an onnxruntime session on one thread."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    return onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
