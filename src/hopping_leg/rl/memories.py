"""What a policy file may remember from tick to tick, as parts of its graph."""

from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.controllers.policy import MEMORY, NEXT_MEMORY
from hopping_leg.rl.graph import Graph, Layers


class Memory(Protocol):
    """A part in front of a policy's dense layers."""

    @property
    def size(self) -> int:
        """Entries that are remembered."""
        ...

    def build(self, graph: Graph, x: str, inputs: int) -> str:
        """Put it behind the normalised inputs; return what the dense layers see.

        Args:
            graph: Under construction; gets the values ``NEXT_MEMORY``.
            x: The normalised inputs, (n, inputs).
            inputs: How many.
        """
        ...


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
    def size(self) -> int:
        """Entries k of its memory."""
        return int(self.of_memory.shape[1])

    def build(self, graph: Graph, x: str, inputs: int) -> str:
        """Show the dense layers what is remembered.

        ONNX wants a sequence, here of one tick, and the gates in the order update, reset,
        candidate.
        """

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
class CommandIntegrator:
    """Where a policy aims so that its hops come true, see ``rl.distillation.adaptive_student``.

    Remembers the aim at both ends of the range of commands and the command of late, all as the
    command is normalised, which must be the last input.

    Attributes:
        layers: Of the network that feels from inputs and command of late, (n, inputs + 1), how far
            the last hop was off; tanh.
        rate: Share of that by which the aim moves in a tick.
        most: Largest error that is felt, in the network's scale.
        farthest: Largest aim.
        beyond: How far outside of the commands' range, -1 to 1, the dense layers may be told.
        follow: Share of its distance by which the command of late follows in a tick.
    """

    layers: Layers
    rate: float
    most: float
    farthest: float
    beyond: float
    follow: float
    size: ClassVar[int] = 3

    def build(self, graph: Graph, x: str, inputs: int) -> str:
        """Tell the dense layers the aim instead of the command."""
        apply, constant = graph.apply, graph.constant
        sizes = constant("input_sizes", np.array([inputs - 1, 1], np.int64))
        graph.add("Split", [x, sizes], ["samples", "asked"], axis=1)
        graph.add(
            "Split",
            [MEMORY, constant("memory_sizes", np.array([2, 1], np.int64))],
            ["ends", "late"],
            axis=1,
        )
        across = constant("across", np.array([1], np.int64))
        slopes, middle = constant("slopes", [[-0.5, 0.5]]), constant("middle", [0.5, 0.5])
        leaning = apply("Gemm", ["asked", slopes, middle], "leaning")
        shares = graph.clip(leaning, 0.0, 1.0, "shares", "shares_")
        weighted = apply("Mul", ["ends", shares], "weighted")
        aim = apply("ReduceSum", [weighted, across], "aim", keepdims=1)
        bound = 1 + self.beyond
        told = graph.clip(apply("Add", ["asked", aim], "aimed"), -bound, bound, "told", "told_")

        noticed = apply("Concat", [x, "late"], "noticed", axis=1)
        shown = graph.dense(noticed, self.layers, "tanh", "felt_")
        felt = graph.clip(shown, -self.most, self.most, "felt", "felt_")
        moved = apply("Mul", [felt, constant("rate", self.rate)], "moved")
        squares = apply("Mul", [shares, shares], "squares")
        both = apply("ReduceSum", [squares, across], "both", keepdims=1)
        steps = apply("Mul", [apply("Div", [moved, both], "scaled"), shares], "steps")
        moved_ends = apply("Sub", ["ends", steps], "moved_ends")
        ends = graph.clip(moved_ends, -self.farthest, self.farthest, "next_ends", "ends_")
        distance = apply("Sub", ["asked", "late"], "distance")
        following = apply("Mul", [distance, constant("follow", self.follow)], "following")
        late = apply("Add", ["late", following], "next_late")
        apply("Concat", [ends, late], NEXT_MEMORY, axis=1)
        return apply("Concat", ["samples", told], "told_inputs", axis=1)
