"""Soft actor-critic with the hyper-parameters of a recipe.

Its actor sees what the robot measures; its critics, which are thrown away afterwards, see the true
state: in flight the joints do not tell the height that the reward speaks of.
"""

from dataclasses import dataclass
from typing import Any

import gymnasium
import torch
from stable_baselines3.common.policies import ContinuousCritic
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.sac.policies import Actor, SACPolicy
from torch import nn

from hopping_leg.envs.task import HoppingTask
from hopping_leg.rl import resumable, sb3_env


@dataclass(frozen=True)
class NetworkConfig:
    """Networks of actor and critic."""

    actor: tuple[int, ...]
    """Hidden layers of the actor, ReLU."""
    critic: tuple[int, ...]
    """Hidden layers of the critic."""


@dataclass(frozen=True)
class SACConfig:
    """Soft actor-critic with generalised state-dependent exploration (gSDE).

    What is not named is as in stable-baselines3.
    """

    learning_rate: float = 5e-4
    """Learning rate of all networks at the start; falls linearly to a tenth."""
    buffer_size: int = 300_000
    """Transitions in the replay buffer."""
    learning_starts: int = 2_000
    """Steps of uniformly random torque before the first gradient step."""
    batch_size: int = 256
    """Transitions per gradient step."""
    gamma: float = 0.99
    """Discount factor per control step: a horizon of half a second, about one hop."""
    train_freq: int = 32
    """Control steps between updates, each environment; gSDE keeps its noise as long, 0.16 s."""
    gradient_steps: int = 128
    """Gradient steps after each rollout: one for every 4 steps of experience."""
    log_std: float = -2.0
    """Initial log standard deviation of gSDE's weights."""

    def make_learner(
        self, task: HoppingTask, network: NetworkConfig, seed: int
    ) -> resumable.ResumableSAC:
        """Build SAC with asymmetric critics."""
        rate = self.learning_rate
        return resumable.ResumableSAC(
            AsymmetricSACPolicy,
            sb3_env.TaskVecEnv(task),
            learning_rate=lambda remaining: rate * (0.1 + 0.9 * remaining),
            buffer_size=self.buffer_size,
            learning_starts=self.learning_starts,
            batch_size=self.batch_size,
            gamma=self.gamma,
            train_freq=self.train_freq,
            gradient_steps=self.gradient_steps,
            use_sde=True,
            sde_sample_freq=-1,
            policy_kwargs={
                "net_arch": {"pi": list(network.actor), "qf": list(network.critic)},
                "activation_fn": nn.ReLU,
                "log_std_init": self.log_std,
                "actor_size": task.observation.size,
            },
            seed=seed,
            device="cpu",
        )


class _Columns(BaseFeaturesExtractor):  # type: ignore[misc]
    """Passes on some entries of an observation."""

    def __init__(self, space: gymnasium.spaces.Box, columns: slice) -> None:
        super().__init__(space, len(range(space.shape[0])[columns]))
        self._columns = columns

    def forward(self, observation: torch.Tensor) -> torch.Tensor:
        """Return the entries, (n, features_dim)."""
        return observation[:, self._columns]


class AsymmetricSACPolicy(SACPolicy):  # type: ignore[misc]
    """SAC whose actor sees the first ``actor_size`` entries and whose critics the others."""

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
