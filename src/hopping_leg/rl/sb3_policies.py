"""An actor that sees what the robot measures, and a critic that sees the true state.

Only in training: the critic is thrown away afterwards. ``TaskVecEnv`` with ``privileged`` joins
both to one observation, actor's part first.
"""

from typing import Any

import gymnasium
import torch
from stable_baselines3.common.policies import ActorCriticPolicy, ContinuousCritic
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.sac.policies import Actor, SACPolicy
from torch import nn


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

    Args:
        actor_size: Entries that are measured.
        actor_sees: Entries that the actor sees instead.
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
        seen = _Columns(self.observation_space, slice(None, self._actor_size))
        return super().make_actor(seen)

    def make_critic(
        self, features_extractor: BaseFeaturesExtractor | None = None
    ) -> ContinuousCritic:
        """Build a pair of critics on the true state."""
        seen = _Columns(self.observation_space, slice(self._actor_size, None))
        return super().make_critic(seen)


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
