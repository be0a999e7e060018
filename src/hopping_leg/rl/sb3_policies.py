"""SAC whose actor sees what the robot measures and whose critics see the true state.

Only in training: the critics are thrown away afterwards. ``TaskVecEnv`` with ``privileged`` joins
both to one observation, actor's part first.
"""

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
import torch
from stable_baselines3.common.policies import ContinuousCritic
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.sac.policies import Actor, SACPolicy
from torch import nn

from hopping_leg.arrays import Array
from hopping_leg.envs.observation import Observation
from hopping_leg.errors import UsageError
from hopping_leg.rl.onnx_export import Network


class _Columns(BaseFeaturesExtractor):  # type: ignore[misc]
    """Passes on some entries of an observation."""

    def __init__(self, space: gymnasium.spaces.Box, columns: slice) -> None:
        super().__init__(space, len(range(space.shape[0])[columns]))
        self._columns = columns

    def forward(self, observation: torch.Tensor) -> torch.Tensor:
        """Return the entries, (n, features_dim)."""
        return observation[:, self._columns]


class AsymmetricSACPolicy(SACPolicy):  # type: ignore[misc]
    """SAC policy whose actor sees the first ``actor_size`` entries and whose critics the others."""

    def __init__(self, *args: Any, actor_size: int, **kwargs: Any) -> None:  # noqa: ANN401
        self._actor_size = actor_size
        super().__init__(*args, **kwargs)

    def make_actor(self, features_extractor: BaseFeaturesExtractor | None = None) -> Actor:
        """Build the actor on the measurements."""
        return super().make_actor(_Columns(self.observation_space, slice(self._actor_size)))

    def make_critic(
        self, features_extractor: BaseFeaturesExtractor | None = None
    ) -> ContinuousCritic:
        """Build a pair of critics on the true state."""
        return super().make_critic(_Columns(self.observation_space, slice(self._actor_size, None)))


def dense(inputs: int, hidden: list[int], activation: type[nn.Module]) -> nn.Sequential:
    """Return hidden layers, each with its activation."""
    layers: list[nn.Module] = []
    for size in hidden:
        layers += [nn.Linear(inputs, size), activation()]
        inputs = size
    return nn.Sequential(*layers)


_NAMES = {nn.ReLU: "relu", nn.Tanh: "tanh", nn.ELU: "elu"}


def dense_network(
    parts: Sequence[nn.Module], observation: Observation, squash: str, before: int = 0
) -> Network:
    """Return dense layers, given in order, with the task's normalisation.

    The output is brought to -1..1 by ``squash``; ``before`` entries stand before the observation in
    what the first layer sees. Raises ``UsageError`` for other layers.
    """
    modules = [leaf for part in parts for leaf in flatten(part)]
    bound = float("inf")
    if isinstance(modules[-1], nn.Hardtanh):
        bound = float(modules[-1].max_val)
        modules = modules[:-1]
    layers = [layer_weights(m) for m in modules if isinstance(m, nn.Linear)]
    kinds = {type(m) for m in modules} - {nn.Linear}
    if len(kinds) != 1 or not kinds <= _NAMES.keys():
        raise UsageError(
            f"An actor of {sorted(k.__name__ for k in kinds)} cannot be exported; use dense layers"
            f" with one of {', '.join(_NAMES.values())}."
        )
    order = np.concatenate([np.arange(before), before + observation.order])
    layers[0] = (layers[0][0][:, order], layers[0][1])
    scaling = observation.scaling
    return Network(scaling.offset, scaling.gain, layers, _NAMES[kinds.pop()], squash, bound)


def flatten(module: nn.Module) -> list[nn.Module]:
    """Return the layers of nested sequences in order."""
    if isinstance(module, nn.Sequential):
        return [leaf for child in module for leaf in flatten(child)]
    return [module]


def layer_weights(layer: nn.Linear) -> tuple[Array, Array]:
    """Return weight (out, in) and bias (out,) of a layer."""
    with torch.no_grad():
        return layer.weight.double().numpy(), layer.bias.double().numpy()
