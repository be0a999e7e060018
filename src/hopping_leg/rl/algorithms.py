"""The algorithms of stable-baselines3 with the hyper-parameters of a recipe."""

import math
from dataclasses import dataclass
from typing import Any

import torch
from torch import nn

from hopping_leg.rl import resumable, sb3_env, sb3_policies


@dataclass(frozen=True)
class NetworkConfig:
    """Networks of actor and critic."""

    actor: tuple[int, ...]
    """Hidden layers of the actor; tanh for PPO, ReLU for SAC."""
    critic: tuple[int, ...]
    """Hidden layers of the critic."""
    privileged_critic: bool = True
    """Let the critic see the true state in training: in flight the joints do not tell the height
    that the reward speaks of."""


@dataclass(frozen=True)
class PPOConfig:
    """Proximal policy optimisation with generalised state-dependent exploration (gSDE)."""

    learning_rate: float = 1e-3
    """Learning rate at the start; falls along a cosine to a fiftieth, so that late snapshots do not
    drift."""
    n_steps: int = 64
    """Control steps between updates, each environment."""
    batch_size: int = 4096
    """Control steps per gradient step."""
    n_epochs: int = 4
    """Passes over a rollout."""
    gamma: float = 0.99
    """Discount factor per control step."""
    gae_lambda: float = 0.97
    """Decay of the generalised advantage estimate."""
    sde_sample_freq: int = 24
    """Control steps that gSDE keeps its noise, 0.12 s: about a push-off; 0 is white noise."""
    log_std: tuple[float, float] = (-2.0, -3.8)
    """Log standard deviation of gSDE's weights at the start and from ``log_std_until`` on."""
    log_std_until: float = 0.6
    """Share of the training after which exploration quietens no more."""

    def make_model(
        self, env: sb3_env.TaskVecEnv, network: NetworkConfig, seed: int
    ) -> resumable.ResumablePPO:
        """Build PPO, with an asymmetric critic if it is privileged."""
        seen = {"actor_size": env.task.observation.size} if network.privileged_critic else {}
        return resumable.ResumablePPO(
            sb3_policies.AsymmetricPolicy if network.privileged_critic else "MlpPolicy",
            env,
            learning_rate=self.rate,
            **self.options(seed),
            policy_kwargs={**self.policy_options(network), **seen},
        )

    def options(self, seed: int) -> dict[str, Any]:
        """Return what PPO is built with, learning rate and policy apart."""
        return {
            "n_steps": self.n_steps,
            "batch_size": self.batch_size,
            "n_epochs": self.n_epochs,
            "gamma": self.gamma,
            "gae_lambda": self.gae_lambda,
            "ent_coef": 0.0,
            "vf_coef": 1.0,
            "max_grad_norm": 1.0,
            "use_sde": self.sde_sample_freq > 0,
            "sde_sample_freq": self.sde_sample_freq or -1,
            "seed": seed,
            "device": "cpu",
        }

    def policy_options(self, network: NetworkConfig) -> dict[str, Any]:
        """Return what actor and critic are built with."""
        return {
            "net_arch": {"pi": list(network.actor), "vf": list(network.critic)},
            "activation_fn": nn.Tanh,
            "log_std_init": self.log_std[0],
        }

    def rate(self, left: float) -> float:
        """Return the learning rate where a share of the training is left, 1 to 0."""
        return self.learning_rate * cosine(left)

    def anneal(self, model: Any, share: float) -> None:  # noqa: ANN401
        """Quieten exploration at a share of the training, 0 to 1."""
        first, last = self.log_std
        with torch.no_grad():
            model.policy.log_std.fill_(
                first + (last - first) * min(1.0, share / self.log_std_until)
            )


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

    def make_model(
        self, env: sb3_env.TaskVecEnv, network: NetworkConfig, seed: int
    ) -> resumable.ResumableSAC:
        """Build SAC, with asymmetric critics if they are privileged."""
        rate = self.learning_rate
        seen = {"actor_size": env.task.observation.size} if network.privileged_critic else {}
        return resumable.ResumableSAC(
            sb3_policies.AsymmetricSACPolicy if network.privileged_critic else "MlpPolicy",
            env,
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

    def anneal(self, model: Any, share: float) -> None:  # noqa: ANN401
        """Change nothing: the learning rate alone falls."""


def cosine(left: float) -> float:
    """Fall from 1 to 0.02 as the share of the budget that is left falls from 1 to 0."""
    return 0.02 + 0.98 * (1 + math.cos(math.pi * (1 - left))) / 2
