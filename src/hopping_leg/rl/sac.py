"""Soft actor-critic with the hyper-parameters of a recipe.

Its actor sees what the robot measures; its critics, which are thrown away afterwards, may see the
true state.
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
    privileged_critic: bool = True
    """Let the critic see the true state in training: in flight the joints do not tell the height
    that the reward speaks of."""


@dataclass(frozen=True)
class SACConfig:
    """Soft actor-critic with generalised state-dependent exploration (gSDE)."""

    learning_rate: float = 5e-4
    """Learning rate of all networks at the start; falls linearly to a tenth."""
    buffer_size: int = 300_000
    """Transitions in the replay buffer."""
    learning_starts: int = 2_000
    """Steps of uniformly random torque before the first gradient step."""
    batch_size: int = 256
    """Transitions per gradient step."""
    n_steps: int = 1
    """Control steps of measured reward before the critic's own estimate."""
    tau: float = 0.005
    """Share by which the target critics follow the critics at each gradient step."""
    gamma: float = 0.99
    """Discount factor per control step: a horizon of half a second, about one hop."""
    train_freq: int = 32
    """Control steps between updates, each environment; gSDE keeps its noise as long, 0.16 s."""
    gradient_steps: int = 128
    """Gradient steps after each rollout: one for every 4 steps of experience."""
    target_entropy: float = -2.0
    """Entropy that SAC's coefficient aims for; the usual minus one per action."""
    log_std: float = -2.0
    """Initial log standard deviation of gSDE's weights."""

    def make_learner(
        self, task: HoppingTask, network: NetworkConfig, seed: int
    ) -> resumable.ResumableSAC:
        """Build SAC, with asymmetric critics if they are privileged."""
        rate = self.learning_rate
        seen = {"actor_size": task.observation.size} if network.privileged_critic else {}
        return resumable.ResumableSAC(
            AsymmetricSACPolicy if network.privileged_critic else "MlpPolicy",
            sb3_env.TaskVecEnv(task, privileged=network.privileged_critic),
            learning_rate=lambda remaining: rate * (0.1 + 0.9 * remaining),
            buffer_size=self.buffer_size,
            learning_starts=self.learning_starts,
            batch_size=self.batch_size,
            tau=self.tau,
            gamma=self.gamma,
            n_steps=self.n_steps,
            train_freq=self.train_freq,
            gradient_steps=self.gradient_steps,
            target_entropy=self.target_entropy,
            use_sde=True,
            sde_sample_freq=-1,
            policy_kwargs={
                "net_arch": {"pi": list(network.actor), "qf": list(network.critic)},
                "activation_fn": nn.ReLU,
                "log_std_init": self.log_std,
                **seen,
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
    """SAC policy whose actor sees the first ``actor_size`` entries and whose critics the others.

    ``TaskVecEnv`` with ``privileged`` joins both to one observation.
    """

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
