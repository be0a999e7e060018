"""An actor that sees what the robot measures, and a critic that sees the true state.

Only in training: the critic is thrown away afterwards. ``TaskVecEnv`` with ``privileged`` joins
both to one observation, actor's part first.
"""

from collections.abc import Sequence
from typing import Any

import gymnasium
import torch
from stable_baselines3 import SAC
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.policies import ActorCriticPolicy, ContinuousCritic
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.sac.policies import Actor, SACPolicy
from torch import nn

from hopping_leg.arrays import Array
from hopping_leg.envs.observation import Observation
from hopping_leg.errors import UsageError
from hopping_leg.rl.onnx_export import Network


class _Split(nn.Module):
    """Separate networks for the two parts of an observation, as stable-baselines3 wants them."""

    def __init__(
        self,
        actor: slice | list[int],
        critic: slice,
        inputs: int,
        sizes: dict[str, list[int]],
        activation: type[nn.Module],
    ) -> None:
        super().__init__()
        self._actor, self._critic = actor, critic
        self.policy_net = dense(_width(actor, inputs), sizes["pi"], activation)
        self.value_net = dense(_width(critic, inputs), sizes["vf"], activation)
        self.latent_dim_pi, self.latent_dim_vf = sizes["pi"][-1], sizes["vf"][-1]

    def forward(self, features: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the last hidden layers of actor and critic."""
        return self.forward_actor(features), self.forward_critic(features)

    def forward_actor(self, features: torch.Tensor) -> torch.Tensor:
        """Return the actor's last hidden layer."""
        hidden: torch.Tensor = self.policy_net(features[:, self._actor])
        return hidden

    def forward_critic(self, features: torch.Tensor) -> torch.Tensor:
        """Return the critic's last hidden layer."""
        hidden: torch.Tensor = self.value_net(features[:, self._critic])
        return hidden


class AsymmetricPolicy(ActorCriticPolicy):  # type: ignore[misc]
    """PPO policy whose actor sees the first ``actor_size`` entries and whose critic the others.

    The actor sees the entries ``actor_sees`` instead where they are given.
    """

    def __init__(
        self,
        *args: Any,  # noqa: ANN401
        actor_size: int,
        actor_sees: list[int] | None = None,
        **kwargs: Any,  # noqa: ANN401
    ) -> None:
        self._actor_sees = actor_sees or slice(actor_size)
        self._critic_sees = slice(actor_size, None)
        super().__init__(*args, **kwargs)

    def _build_mlp_extractor(self) -> None:
        self.mlp_extractor = _Split(
            self._actor_sees,
            self._critic_sees,
            self.features_dim,
            self.net_arch,
            self.activation_fn,
        )


class _Columns(BaseFeaturesExtractor):  # type: ignore[misc]
    """Passes on some entries of an observation."""

    def __init__(self, space: gymnasium.spaces.Box, columns: slice) -> None:
        super().__init__(space, _width(columns, space.shape[0]))
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


def _width(part: slice | list[int], inputs: int) -> int:
    """Return how many of so many entries a part has."""
    return len(part) if isinstance(part, list) else len(range(inputs)[part])


def dense(inputs: int, hidden: list[int], activation: type[nn.Module]) -> nn.Sequential:
    """Return hidden layers, each with its activation."""
    layers: list[nn.Module] = []
    for size in hidden:
        layers += [nn.Linear(inputs, size), activation()]
        inputs = size
    return nn.Sequential(*layers)


_NAMES = {nn.ReLU: "relu", nn.Tanh: "tanh", nn.ELU: "elu"}


def network_of(model: BaseAlgorithm, observation: Observation) -> Network:
    """Return the actor of SAC or PPO with the task's normalisation; ``UsageError`` if not dense."""
    if isinstance(model, SAC):
        return dense_network([model.actor.latent_pi, model.actor.mu], observation, "tanh")
    policy = model.policy
    return dense_network([policy.mlp_extractor.policy_net, policy.action_net], observation, "clip")


def dense_network(parts: Sequence[nn.Module], observation: Observation, squash: str) -> Network:
    """Return dense layers, given in order, with the task's normalisation.

    The output is brought to -1..1 by ``squash``; raises ``UsageError`` for other layers.
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
    layers[0] = (layers[0][0][:, observation.order], layers[0][1])
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
