"""The fast recipe: accurate hopping in minutes on two cores.

PPO on many legs at once. What makes it fast, largest lever first: state-dependent exploration
(gSDE), a critic that sees the true state, a reward at the apex itself, joint samples that say when
they were taken, episodes that begin on the hop they should end in.
"""

import math
from dataclasses import dataclass, field
from typing import Any, ClassVar

import torch
from torch import nn

from hopping_leg.envs import ApexRewardConfig, Reward, TaskConfig, apex_reward
from hopping_leg.rl.recipe import Recipe
from hopping_leg.rl.resumable import ResumablePPO
from hopping_leg.rl.sb3_env import TaskVecEnv
from hopping_leg.rl.sb3_policies import AsymmetricPolicy
from hopping_leg.robot.parameters import Robot


@dataclass(frozen=True)
class FastRecipe(Recipe):
    """PPO + gSDE on dated joint samples, with an asymmetric critic and the apex reward."""

    name: ClassVar[str] = "fast"

    task: TaskConfig = field(
        default_factory=lambda: TaskConfig(
            observation="dated",
            command_range=(0.22, 0.40),
            command_resampling_time=(1.0, 5.0),
            reset_distribution="hop",
            random_episode_start=True,
            timestep=1e-3,
        )
    )
    reward: ApexRewardConfig = field(default_factory=ApexRewardConfig)
    """Apex reward."""
    num_envs: int = 512
    """Legs that gather experience at once."""
    steps: int = 6_000_000
    """Control steps of experience in all, summed over the legs."""
    eval_every: int = 600_000
    """Control steps between two trials of the deterministic policy, for checkpoint selection."""
    log_every: int = 4
    """Updates between two entries in the TensorBoard log."""
    actor: tuple[int, ...] = (128, 64)
    """Hidden layers of the actor, tanh."""
    critic: tuple[int, ...] = (256, 128)
    """Hidden layers of the critic, tanh."""
    learning_rate: float = 1e-3
    """At the start; falls along a cosine to a fiftieth, so that late snapshots do not drift."""
    n_steps: int = 64
    """Ticks between updates, each leg."""
    batch_size: int = 4096
    """Ticks per gradient step."""
    n_epochs: int = 4
    """Passes over a rollout."""
    gamma: float = 0.99
    """Discount per tick."""
    gae_lambda: float = 0.97
    """Of the advantage estimate."""
    sde_sample_freq: int = 24
    """Ticks that gSDE keeps its noise, 0.12 s: about a push-off; 0 explores with white noise."""
    log_std: tuple[float, float] = (-2.0, -3.8)
    """Log standard deviation of gSDE's weights at the start and from ``log_std_until`` on."""
    log_std_until: float = 0.6
    """Share of the training after which exploration quietens no more."""

    def make_reward(self, robot: Robot) -> Reward:
        """Build the apex reward."""
        return apex_reward(robot, self.reward, self.task.rate)

    def make_model(self, env: TaskVecEnv, seed: int) -> ResumablePPO:
        """Build PPO with gSDE and an asymmetric critic."""
        seen = {"actor_size": env.task.observation.size} if self.privileged_critic else {}
        return ResumablePPO(
            AsymmetricPolicy if self.privileged_critic else "MlpPolicy",
            env,
            **self.ppo_options(seed),
            policy_kwargs={**self.network_options(), **seen},
        )

    def ppo_options(self, seed: int) -> dict[str, Any]:
        """Return what PPO is built with, the policy's options apart."""
        return {
            "learning_rate": self.rate,
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

    def network_options(self) -> dict[str, Any]:
        """Return what actor and critic are built with."""
        return {
            "net_arch": {"pi": list(self.actor), "vf": list(self.critic)},
            "activation_fn": nn.Tanh,
            "log_std_init": self.log_std[0],
        }

    def rate(self, left: float) -> float:
        """Return the learning rate where a share of the training is left, 1 to 0."""
        return self.learning_rate * cosine(left)

    def anneal(self, model: Any, env: TaskVecEnv, share: float) -> None:  # noqa: ANN401
        """Sharpen the reward and quieten exploration."""
        env.task.reward.anneal(share)
        first, last = self.log_std
        with torch.no_grad():
            model.policy.log_std.fill_(
                first + (last - first) * min(1.0, share / self.log_std_until)
            )


def cosine(left: float) -> float:
    """Fall from 1 to 0.02 as the share of the budget that is left falls from 1 to 0."""
    return 0.02 + 0.98 * (1 + math.cos(math.pi * (1 - left))) / 2
