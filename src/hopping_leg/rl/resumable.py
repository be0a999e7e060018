"""Soft actor-critic of stable-baselines3 that can be stopped and continued without a trace.

The state is taken at the entry of ``collect_rollouts``: after the gradient steps, before the next
exploration noise is drawn. Continuing from there is the same as never having stopped, bit by bit.
"""

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from stable_baselines3 import SAC

from hopping_leg.envs.task import HoppingTask
from hopping_leg.rl.checkpoint import Tree, to_torch
from hopping_leg.rl.onnx_export import Actor, DenseActor
from hopping_leg.rl.sb3_env import TaskVecEnv

_COUNTERS = ("num_timesteps", "_episode_num", "_n_updates", "_current_progress_remaining")
_REPLAY = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")


class ResumableSAC(SAC):  # type: ignore[misc]
    """Soft actor-critic on a ``TaskVecEnv``; ``Learner`` has the same attributes."""

    on_boundary: Callable[[], None] | None = None
    remaining: Callable[[], float] | None = None
    env: TaskVecEnv
    seconds: dict[str, float]
    _current_progress_remaining: float

    @property
    def task(self) -> HoppingTask:
        """The legs that learn."""
        return self.env.task

    @property
    def share(self) -> float:
        """Share of the training that is done, 0 to 1."""
        return 1 - float(self._current_progress_remaining)

    def _setup_model(self) -> None:
        super()._setup_model()
        self.seconds = {"rollouts": 0.0, "gradient steps": 0.0}

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
        for name, mean in self.env.take_reward_terms().items():
            self.logger.record_mean(f"reward/{name}", mean)
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
        filled = buffer.buffer_size if buffer.full else buffer.pos
        tree = {
            "policy": self.policy.state_dict(),
            "optimizers": [o.state_dict() for o in _optimizers(self)],
            "counters": {name: getattr(self, name) for name in _COUNTERS},
            "env": self.env.state(),
            "last_observation": self._last_obs,
            "last_episode_starts": self._last_episode_starts,
            "random": _random_state(self),
            "replay": {
                "pos": buffer.pos,
                "full": buffer.full,
                "arrays": {name: getattr(buffer, name)[:filled] for name in _REPLAY},
            },
        }
        if self.log_ent_coef is not None:
            tree["log_ent_coef"] = self.log_ent_coef.detach().numpy().copy()
        return tree

    def restore(self, state: Tree) -> None:
        """Bring a freshly built learner of the same recipe to a ``state``."""
        self.env.restore(state["env"])
        self.policy.load_state_dict(to_torch(state["policy"]))
        if "log_ent_coef" in state:
            self.log_ent_coef.data.copy_(torch.from_numpy(state["log_ent_coef"]))
        for optimizer, tree in zip(_optimizers(self), state["optimizers"], strict=True):
            optimizer.load_state_dict(to_torch(tree))
        for name, value in state["counters"].items():
            setattr(self, name, value)
        self._last_obs = state["last_observation"]
        self._last_episode_starts = state["last_episode_starts"]
        buffer, replay = self.replay_buffer, state["replay"]
        for name, values in replay["arrays"].items():
            getattr(buffer, name)[: len(values)] = values
        buffer.pos, buffer.full = replay["pos"], replay["full"]
        _restore_random(self, state["random"])


def _optimizers(model: SAC) -> list[torch.optim.Optimizer]:
    own = [model.actor.optimizer, model.critic.optimizer]
    return own + ([model.ent_coef_optimizer] if model.ent_coef_optimizer is not None else [])


def _random_state(model: SAC) -> Tree:
    kind, keys, position, has_gauss, gauss = np.random.get_state(legacy=True)  # noqa: NPY002
    return {
        "torch": torch.get_rng_state().numpy(),
        "numpy": [str(kind), np.asarray(keys), int(position), int(has_gauss), float(gauss)],
        "actions": model.action_space.np_random.bit_generator.state,
    }


def _restore_random(model: SAC, state: Tree) -> None:
    torch.set_rng_state(torch.from_numpy(state["torch"]))
    np.random.set_state(tuple(state["numpy"]))  # noqa: NPY002
    model.action_space.np_random.bit_generator.state = state["actions"]
