"""Reinforcement learning beside the distillation: a teacher that learns, a student that is refined.

Both are PPO of stable-baselines3 on the reward that judges apexes (``apex_reward``), with the
critic on the true state. The teacher sees the true state and its own last action, and learns from
scratch; the refined student begins at the weights of a distillation.
"""

from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.torch_layers import create_mlp
from torch import nn

from hopping_leg import envs
from hopping_leg.arrays import Array, Array32
from hopping_leg.rl.distillation.dagger import Dagger, cosine
from hopping_leg.rl.distillation.students import StudentConfig, WindowStudent
from hopping_leg.rl.onnx_export import Actor, DenseActor
from hopping_leg.rl.recipe import Recipe
from hopping_leg.rl.sb3_env import TaskVecEnv
from hopping_leg.robot import Robot
from hopping_leg.sim import LegSimulator

REWARD = envs.ApexRewardConfig(
    width=(0.030, 0.006), energy=0.8, energy_beyond=0.05, jerk=0.5, effort=0.2
)
_LOG_STD = (-2.0, -3.8)
_QUIET_FROM = 0.6


class _Split(nn.Module):
    """Actor on the first entries of an observation, critic on the others."""

    def __init__(self, actor: int, inputs: int, hidden: list[int]) -> None:
        super().__init__()
        self._actor = actor
        self.policy_net = nn.Sequential(*create_mlp(actor, -1, hidden, nn.Tanh))
        self.value_net = nn.Sequential(*create_mlp(inputs - actor, -1, [256, 128], nn.Tanh))
        self.latent_dim_pi, self.latent_dim_vf = hidden[-1], 128

    def forward(self, seen: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the last hidden layers of both."""
        return self.forward_actor(seen), self.forward_critic(seen)

    def forward_actor(self, seen: torch.Tensor) -> torch.Tensor:
        """Return the actor's last hidden layer."""
        return self.policy_net(seen[:, : self._actor])

    def forward_critic(self, seen: torch.Tensor) -> torch.Tensor:
        """Return the critic's last hidden layer."""
        return self.value_net(seen[:, self._actor :])


class _Policy(ActorCriticPolicy):  # type: ignore[misc]
    def __init__(self, *args: Any, actor: int, hidden: list[int], **kwargs: Any) -> None:  # noqa: ANN401
        self._sizes = actor, hidden
        super().__init__(*args, **kwargs)

    def _build_mlp_extractor(self) -> None:
        actor, hidden = self._sizes
        self.mlp_extractor = _Split(actor, self.features_dim, hidden)


class _TrueState(TaskVecEnv):
    """Shows the true state and the last action."""

    def __init__(self, task: envs.HoppingTask) -> None:
        super().__init__(task)
        size = task.privileged_size + 2
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (size,), np.float32)

    def _observation(self, seen: Array32) -> Array32:
        return true_state(self.task)

    def _end_episodes(self, step: Any, done: Any) -> list[dict[str, Any]]:  # noqa: ANN401
        infos = super()._end_episodes(step, done)
        for leg in np.flatnonzero(done):
            last = np.append(step.final_privileged[leg], np.zeros(2, np.float32))
            infos[leg]["terminal_observation"] = last
        return infos


def true_state(task: envs.HoppingTask) -> Array32:
    """Return what a teacher that learns sees, (n, size)."""
    return np.concatenate([task.privileged(), task.last_action], axis=1, dtype=np.float32)


def _ppo(
    env: TaskVecEnv,
    rate: float,
    log_std: float,
    seed: int,
    policy: str | type[_Policy],
    **of: object,
) -> PPO:
    return PPO(
        policy, env, learning_rate=lambda left: rate * cosine(left), n_steps=64, batch_size=4096,
        n_epochs=8, gamma=0.99, gae_lambda=0.97, ent_coef=0.0, vf_coef=1.0, max_grad_norm=1.0,
        use_sde=True, sde_sample_freq=24, seed=seed, device="cpu",
        policy_kwargs={"log_std_init": log_std, "activation_fn": nn.Tanh, **of},
    )  # fmt: skip


def _learn(model: PPO, env: TaskVecEnv, steps: int, log_std: tuple[float, float]) -> None:
    def anneal(*_: Any) -> bool:  # noqa: ANN401
        share = min(model.num_timesteps / steps, 1.0)
        env.task.reward.anneal(share)
        quiet = min(1.0, share / _QUIET_FROM)
        with torch.no_grad():
            model.policy.log_std.fill_(log_std[0] + (log_std[1] - log_std[0]) * quiet)
        return True

    model.learn(steps, callback=anneal)


def _task(recipe: Recipe, robot: Robot, seed: int) -> envs.HoppingTask:
    reward = envs.apex_reward(robot, REWARD, recipe.task.rate)
    rng = np.random.default_rng(seed)
    return envs.HoppingTask(robot, recipe.schedule.num_envs, recipe.task, reward, rng, 1)


class LearntTeacher:
    """A teacher that has learnt by PPO; forgets nothing, as it remembers nothing.

    Attributes:
        pushing: Nothing but False: it knows no phases, (n,).
        folding: The same, (n,).
    """

    def __init__(self, policy: ActorCriticPolicy, task: envs.HoppingTask) -> None:
        self._policy, self._task = policy, task
        self._full = np.array(task.options.action_torque)
        self.pushing = self.folding = np.zeros(task.count, bool)

    def watch(self, legs: LegSimulator) -> None:
        """Do nothing: the task shows the true state."""

    def reset(self, count: int) -> None:
        """Do nothing."""

    def torque(self, command: Array) -> Array:
        """Return joint torques for the task's commands, N m, (n, 2)."""
        action, _ = self._policy.predict(true_state(self._task), deterministic=True)
        return np.asarray(action * self._full)

    def state(self) -> dict[str, Array]:
        """Return nothing."""
        return {}

    def restore(self, state: dict[str, Array]) -> None:
        """Do nothing."""


def learn_teacher(
    recipe: Recipe, robot: Robot, seed: int, steps: int
) -> Callable[[envs.HoppingTask], LearntTeacher]:
    """Train a teacher from scratch; return what makes it for a task."""
    env = _TrueState(_task(recipe, robot, seed))
    model = _ppo(
        env, 1e-3, _LOG_STD[0], seed, "MlpPolicy", net_arch={"pi": [128, 64], "vf": [256, 128]}
    )
    _learn(model, env, steps, _LOG_STD)
    return lambda task: LearntTeacher(model.policy, task)


def refine(dagger: Dagger, recipe: Recipe, robot: Robot, seed: int, steps: int) -> Actor:
    """Go on from a distilled student by PPO; return the actor."""
    student = dagger.student
    network = recipe.network
    assert isinstance(student, WindowStudent), "only dense students are refined"
    assert isinstance(network, StudentConfig), "a distillation has a student"
    env = TaskVecEnv(_task(recipe, robot, seed))
    parts = {"actor": env.task.observation.size, "hidden": list(network.hidden)}
    model = _ppo(env, 1e-4, _LOG_STD[1], seed, _Policy, **parts)
    layers = [*model.policy.mlp_extractor.policy_net, model.policy.action_net]
    for own, given in zip(layers, student.layers, strict=True):
        own.load_state_dict(given.state_dict())
    env.task.reward.anneal(1.0)
    _learn(model, env, steps, (_LOG_STD[1], _LOG_STD[1]))
    return DenseActor(*layers)
