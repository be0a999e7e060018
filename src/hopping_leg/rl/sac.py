"""Soft actor-critic of stable-baselines3 with the hyper-parameters of a recipe.

Its actor sees what the robot measures; its critics, which are thrown away afterwards, see the true
state: in flight the joints do not tell the height that the reward speaks of. A training can be
stopped and continued bit by bit: the state is taken at the entry of ``collect_rollouts``, after the
gradient steps and before the next exploration noise is drawn.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np
import torch
from stable_baselines3 import SAC
from stable_baselines3.common.policies import ContinuousCritic
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.common.vec_env import VecEnv, VecMonitor
from stable_baselines3.sac.policies import Actor as SACActor
from stable_baselines3.sac.policies import SACPolicy
from torch import nn

from hopping_leg.arrays import Array, Array32, BoolArray, Stateful
from hopping_leg.envs.task import HoppingTask
from hopping_leg.rl.checkpoint import Tree
from hopping_leg.rl.learner import NetworkConfig
from hopping_leg.rl.onnx_export import Actor, DenseActor

_REPLAY = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")


class TaskVecEnv(Stateful, VecEnv):  # type: ignore[misc]
    """A ``HoppingTask`` for stable-baselines3.

    Observations are (n, size); the true state follows what is measured in the same rows, for
    critics that see it in training. All randomness is the task's; ``seed`` and ``set_options``
    of stable-baselines3 change nothing. Its ``VecMonitor`` tells of whole episodes.
    """

    STATE = ("task",)

    def __init__(self, task: HoppingTask) -> None:
        self.task = task
        size = task.observation.size + task.privileged_size
        space = gymnasium.spaces.Box(-np.inf, np.inf, (size,), np.float32)
        self.render_mode = None
        super().__init__(task.count, space, gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32))
        self._nothing: list[dict[str, Any]] = [{} for _ in range(task.count)]
        self._action: Array32 = np.zeros((task.count, 2), np.float32)

    def reset(self) -> Array32:
        """Begin new episodes of all legs."""
        return self._observation(self.task.reset())

    def step_async(self, actions: Array32) -> None:
        """Keep the actions, (n, 2), for ``step_wait``."""
        self._action = actions

    def step_wait(self) -> tuple[Array32, Array, BoolArray, list[dict[str, Any]]]:
        """Step all legs; legs whose episode ended have begun the next."""
        step = self.task.step(self._action)
        done = step.terminated | step.truncated
        infos = [{} for _ in done] if done.any() else self._nothing
        for leg in np.flatnonzero(done):
            assert step.final_observation is not None
            assert step.final_privileged is not None
            final = step.final_observation[leg], step.final_privileged[leg]
            infos[leg] = {
                "terminal_observation": np.concatenate(final),
                "TimeLimit.truncated": bool(step.truncated[leg]),
            }
        return self._observation(step.observation), step.reward, done, infos

    def _observation(self, seen: Array32) -> Array32:
        return np.concatenate([seen, self.task.privileged()], axis=1)

    def close(self) -> None:
        """Do nothing: the legs hold no resources beyond memory."""

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:  # noqa: ANN401
        """Return an attribute once per selected leg."""
        return [getattr(self, attr_name)] * len(list(self._get_indices(indices)))

    def env_method(self, *_args: Any, **_kwargs: Any) -> Any:  # noqa: ANN401
        """Refuse: legs have neither attributes nor methods of their own."""
        raise NotImplementedError("legs have nothing of their own; set or call what the task has")

    set_attr = env_method

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:  # noqa: ANN401
        """Return False per selected leg."""
        return [False] * len(list(self._get_indices(indices)))


@dataclass(frozen=True)
class SACConfig:
    """Soft actor-critic with gSDE; names, and what is not named, are as in stable-baselines3."""

    learning_rate: float = 1e-3
    """Learning rate of all networks at the start; falls linearly to a tenth."""
    buffer_size: int = 300_000
    """Transitions in the replay buffer."""
    learning_starts: int = 2_000
    """Steps of uniformly random torque before the first gradient step."""
    batch_size: int = 1024
    """Transitions per gradient step."""
    n_steps: int = 8
    """Control steps whose rewards count before a critic's value of what follows."""
    gamma: float = 0.99
    """Discount factor per control step: a horizon of half a second, about one hop."""
    train_freq: int = 32
    """Control steps between updates, each environment; gSDE keeps its noise as long, 0.16 s."""
    gradient_steps: int = 128
    """Gradient steps after each rollout."""
    log_std: float = -2.0
    """Initial log standard deviation of gSDE's weights."""

    def make_learner(self, task: HoppingTask, network: NetworkConfig, seed: int) -> "ResumableSAC":
        """Build SAC with asymmetric critics."""
        options = vars(self).copy()
        rate, log_std = options.pop("learning_rate"), options.pop("log_std")
        learner = ResumableSAC(
            AsymmetricSACPolicy,
            VecMonitor(TaskVecEnv(task)),
            learning_rate=lambda remaining: rate * (0.1 + 0.9 * remaining),
            use_sde=True,
            sde_sample_freq=-1,
            policy_kwargs={
                "net_arch": {"pi": list(network.actor), "qf": list(network.critic)},
                "activation_fn": nn.ReLU,
                "log_std_init": log_std,
                "actor_size": task.observation.size,
            },
            seed=seed,
            device="cpu",
            **options,
        )
        learner.seconds = {"rollouts": 0.0, "gradient steps": 0.0}
        return learner


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

    def make_actor(self, features_extractor: BaseFeaturesExtractor | None = None) -> SACActor:
        """Build the actor on the measurements."""
        return super().make_actor(_Columns(self.observation_space, slice(self._actor_size)))

    def make_critic(
        self, features_extractor: BaseFeaturesExtractor | None = None
    ) -> ContinuousCritic:
        """Build a pair of critics on the true state."""
        return super().make_critic(_Columns(self.observation_space, slice(self._actor_size, None)))


class ResumableSAC(Stateful, SAC):  # type: ignore[misc]
    """Soft actor-critic on a ``TaskVecEnv``; ``Learner`` has the same attributes."""

    STATE = (
        *("policy", "actor.optimizer", "critic.optimizer", "log_ent_coef", "ent_coef_optimizer"),
        *("num_timesteps", "_episode_num", "_n_updates", "_current_progress_remaining"),
        *("env", "_last_obs", "_last_episode_starts", "action_space.np_random"),
    )

    on_boundary: Callable[[], None] | None = None
    remaining: Callable[[], float] | None = None
    env: VecMonitor
    seconds: dict[str, float]
    _current_progress_remaining: float

    @property
    def task(self) -> HoppingTask:
        """The legs that learn."""
        task: HoppingTask = self.env.task
        return task

    @property
    def share(self) -> float:
        """Share of the training that is done, 0 to 1."""
        return 1 - float(self._current_progress_remaining)

    def train_until(self, steps: int, callback: Callable[[], bool], log_interval: int) -> None:
        """Learn until so many control steps are done in all, or until the callback says no."""
        self._update_current_progress_remaining(self.num_timesteps, steps)
        self.learn(
            steps - self.num_timesteps,
            callback=lambda *_: callback(),
            log_interval=log_interval,
            reset_num_timesteps=self.num_timesteps == 0,
        )

    def train(self, *args: Any, **kwargs: Any) -> None:  # noqa: ANN401
        """Take gradient steps as usual."""
        began = time.monotonic()
        super().train(*args, **kwargs)
        self.seconds["gradient steps"] += time.monotonic() - began

    def collect_rollouts(self, *args: Any, **kwargs: Any) -> Any:  # noqa: ANN401
        """Collect a rollout as usual, after the callback."""
        self.task.reward.anneal(self.share)
        if self.on_boundary is not None:
            self.on_boundary()
        began = time.monotonic()
        collected = super().collect_rollouts(*args, **kwargs)
        self.seconds["rollouts"] += time.monotonic() - began
        return collected

    def _update_current_progress_remaining(self, steps: int, total: int) -> None:
        super()._update_current_progress_remaining(steps, total)
        if self.remaining is not None:
            left = self._current_progress_remaining
            self._current_progress_remaining = min(left, self.remaining())

    def network(self) -> Actor:
        """Return the deterministic actor as it stands."""
        return DenseActor(self.actor.latent_pi, self.actor.mu, torch.nn.Tanh())

    def state(self) -> Tree:
        """Return everything needed to continue exactly, its environment included."""
        buffer = self.replay_buffer
        return {
            **super().state(),
            "torch": torch.get_rng_state(),
            "numpy": np.random.get_state(legacy=True),  # noqa: NPY002
            "place": [buffer.pos, buffer.full],
            "replay": {name: getattr(buffer, name)[: buffer.size()] for name in _REPLAY},
        }

    def restore(self, state: Tree) -> None:
        """Bring a freshly built learner of the same recipe to a ``state``."""
        super().restore(state)
        torch.set_rng_state(state["torch"])
        np.random.set_state(tuple(state["numpy"]))  # noqa: NPY002
        buffer = self.replay_buffer
        buffer.pos, buffer.full = state["place"]
        for name, values in state["replay"].items():
            getattr(buffer, name)[: len(values)] = values
