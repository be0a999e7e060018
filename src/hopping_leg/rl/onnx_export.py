"""Policy files: the ONNX graph of one module, from measurements in SI units to torques.

The command is mapped, the inputs are normalised, the actor acts, its actions are bounded and
multiplied with the full torque.
"""

import io
import warnings
from abc import abstractmethod
from collections.abc import Sequence
from typing import Any

import numpy as np
import onnx
import torch
from onnx import helper, numpy_helper
from torch import nn

from hopping_leg.arrays import Array
from hopping_leg.controllers.observation_history import FULL_TORQUE, make_observation_history
from hopping_leg.controllers.policy import MEMORY, METADATA_KEY, NEXT_MEMORY, Card
from hopping_leg.envs import TaskConfig
from hopping_leg.envs.observation import Observation
from hopping_leg.robot import Robot

_OPSET = 17
_SPACING = 0.01
"""Of the heights of a command map, m."""


class Actor(nn.Module):
    """A deterministic network that may remember something."""

    memory_size = 0
    """Entries m of its memory."""

    @abstractmethod
    def forward(
        self, observation: torch.Tensor, memory: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the action, full at -1 and 1, (n, 2), and the next memory, (n, m)."""


class DenseActor(Actor):
    """Layers that remember nothing."""

    def __init__(self, *layers: nn.Module) -> None:
        super().__init__()
        self.layers = nn.Sequential(*layers)

    def forward(
        self, observation: torch.Tensor, memory: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the action; nothing is remembered."""
        return self.layers(observation), memory


def every_centimetre(commands: Sequence[float]) -> tuple[float, ...]:
    """Return heights from the lowest to the highest command, about 1 cm apart, m."""
    low, high = min(commands), max(commands)
    return tuple(map(float, np.linspace(low, high, round((high - low) / _SPACING) + 1)))


class CommandMap(nn.Module):
    """A shift of the command, linear between heights, m, and constant beyond; none at first.

    It is the first height's and, for every height h, the change of the slope there times
    max(command - h, 0).
    """

    heights: torch.Tensor
    first: torch.Tensor
    bends: torch.Tensor

    def __init__(self, heights: Sequence[float]) -> None:
        super().__init__()
        self.register_buffer("heights", torch.tensor(heights))
        self.register_buffer("first", torch.zeros(1))
        self.register_buffer("bends", torch.zeros(len(heights), 1))

    def forward(self, command: torch.Tensor) -> torch.Tensor:
        """Return what commands of any shape become."""
        ramps = torch.relu(command[..., None] - self.heights)
        return command + self.first + (ramps @ self.bends)[..., 0]


class PolicyGraph(nn.Module):
    """What a policy file does: takes a layout's inputs and the memory, gives torques and memory."""

    place: torch.Tensor
    offset: torch.Tensor
    gain: torch.Tensor
    full_torque: torch.Tensor

    def __init__(self, actor: Actor, observation: Observation, card: Card) -> None:
        super().__init__()
        self.layout, self.actor = make_observation_history(card.layout, 1 / card.rate), actor
        self.command_map = CommandMap(every_centimetre((card.command_low, card.command_high)))
        place, scaling = np.argsort(observation.order), observation.scaling
        self.register_buffer("place", torch.from_numpy(place))
        self.register_buffer("offset", torch.from_numpy(scaling.offset[place]).float())
        self.register_buffer("gain", torch.from_numpy(scaling.gain[place]).float())
        self.register_buffer("full_torque", torch.tensor(card.torque_scale))

    @property
    def inputs(self) -> dict[str, tuple[int, ...]]:
        """Names and shapes of what it takes, without the number of legs."""
        size = self.actor.memory_size
        return self.layout.shapes | ({MEMORY: (size,)} if size else {})

    def forward(self, *values: torch.Tensor) -> tuple[torch.Tensor, ...]:
        """Return torques, N m, (n, 2), and the next memory of an actor that has one."""
        given = dict(zip(self.inputs, values, strict=True))
        given["command"] = self.command_map(given["command"])
        joined = torch.cat([given[name].flatten(1) for name in self.layout.network_inputs], dim=1)
        seen = (joined[:, self.place] - self.offset) * self.gain
        action, memory = self.actor(seen, given.get(MEMORY, seen[:, :0]))
        torque = action.clamp(-1, 1) * given.get(FULL_TORQUE, self.full_torque)
        return (torque, memory) if MEMORY in given else (torque,)


def build_policy(actor: Actor, observation: Observation, card: Card) -> bytes:
    """Return a policy file's content, with the card in its metadata."""
    graph = PolicyGraph(actor, observation, card)
    names = ["torque", NEXT_MEMORY][: 1 + (MEMORY in graph.inputs)]
    example = tuple(torch.zeros(1, *shape) for shape in graph.inputs.values())
    file = io.BytesIO()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # this way to export is old, and asks for what is given
        torch.onnx.export(
            graph,
            example,
            file,  # type: ignore[arg-type]
            input_names=list(graph.inputs),
            output_names=names,
            dynamic_axes={name: {0: "n"} for name in (*graph.inputs, *names)},
            opset_version=_OPSET,
            dynamo=False,
        )
    return with_card(file.getvalue(), card)


def make_card(robot: Robot, options: TaskConfig, recipe: str, **about: Any) -> Card:  # noqa: ANN401
    """Return the card of a policy for a task, with more fields as named."""
    return Card(
        recipe, options.observation, *options.command_bounds,
        (float(options.action_torque[0]), float(options.action_torque[1])),
        robot.name, robot.digest, options.rate, **about,
    )  # fmt: skip


def with_card(content: bytes, card: Card) -> bytes:
    """Return a policy file with another card."""
    model = onnx.load_from_string(content)
    helper.set_model_props(model, {METADATA_KEY: card.to_json()})
    return _content(model)


def with_shifts(content: bytes, shifts: Array) -> bytes:
    """Return a policy file whose command is shifted at every centimetre of its range, m."""
    model = onnx.load_from_string(content)
    own = {constant.name: constant for constant in model.graph.initializer}
    heights = numpy_helper.to_array(own["command_map.heights"])
    slopes = np.concatenate([[0.0], np.diff(shifts) / np.diff(heights), [0.0]])
    for name, value in (("first", shifts[:1]), ("bends", np.diff(slopes)[:, None])):
        constant = own[f"command_map.{name}"]
        constant.CopyFrom(numpy_helper.from_array(value.astype(np.float32), constant.name))
    return _content(model)


def _content(model: Any) -> bytes:  # noqa: ANN401
    onnx.checker.check_model(model, full_check=True)
    content: bytes = model.SerializeToString(deterministic=True)
    return content
