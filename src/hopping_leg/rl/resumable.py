"""stable-baselines3 algorithms that can be stopped and continued without a trace.

The state is taken at the entry of ``collect_rollouts``: after the gradient steps, before the next
exploration noise is drawn. Continuing from there is the same as never having stopped, bit by bit.
"""

import random
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.base_class import BaseAlgorithm

from hopping_leg.rl.checkpoint import Tree
from hopping_leg.rl.sb3_env import TaskVecEnv

_COUNTERS = ("num_timesteps", "_episode_num", "_n_updates", "_current_progress_remaining")
_REPLAY = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")


class AtBoundary:
    """Mixin: calls back at the boundary and lets a clock hasten the schedules.

    Attributes:
        on_boundary: Called between the gradient steps and the next rollout.
        remaining: Returns the share of the budget that is left, 1 to 0; the learning rate follows
            this or the share of steps left, whichever is smaller.
    """

    on_boundary: Callable[[], None] | None = None
    remaining: Callable[[], float] | None = None
    _current_progress_remaining: float

    def collect_rollouts(self, *args: Any, **kwargs: Any) -> Any:  # noqa: ANN401
        """Collect a rollout as usual, after the callback."""
        if self.on_boundary is not None:
            self.on_boundary()
        return super().collect_rollouts(*args, **kwargs)  # type: ignore[misc]

    def own_state(self) -> Tree:
        """Return what an algorithm of this project's own remembers beside the library's."""
        return {}

    def restore_own(self, state: Tree) -> None:
        """Go on from an ``own_state``."""

    def _update_current_progress_remaining(self, steps: int, total: int) -> None:
        super()._update_current_progress_remaining(steps, total)  # type: ignore[misc]
        if self.remaining is not None:
            left = self._current_progress_remaining
            self._current_progress_remaining = min(left, self.remaining())


class ResumableSAC(AtBoundary, SAC):  # type: ignore[misc]
    """Soft actor-critic."""


class ResumablePPO(AtBoundary, PPO):  # type: ignore[misc]
    """Proximal policy optimisation."""


def state_of(model: BaseAlgorithm) -> Tree:
    """Return everything needed to continue a model exactly, its environment included."""
    env: TaskVecEnv = model.env
    tree: Tree = {
        **learner_state(model),
        "env": env.state(),
        "last_observation": model._last_obs,
        "last_episode_starts": model._last_episode_starts,
        "episodes": [{"r": e["r"], "l": e["l"], "t": e["t"]} for e in model.ep_info_buffer],
        "random": _random_state(model),
        "own": model.own_state(),
    }
    if isinstance(model, SAC):
        tree["replay"] = _replay_state(model.replay_buffer)
    return tree


def learner_state(model: BaseAlgorithm) -> Tree:
    """Return networks, optimisers and counters alone: no environment, experience or randomness."""
    tree: Tree = {
        "policy": _to_numpy(model.policy.state_dict()),
        "optimizers": [_to_numpy(o.state_dict()) for o in _optimizers(model)],
        "counters": {name: getattr(model, name) for name in _COUNTERS},
    }
    if isinstance(model, SAC) and model.log_ent_coef is not None:
        tree["log_ent_coef"] = model.log_ent_coef.detach().numpy().copy()
    return tree


def restore(model: BaseAlgorithm, tree: Tree) -> None:
    """Bring a freshly built model of the same recipe to a ``state_of``.

    Call ``learn`` with ``reset_num_timesteps=False`` afterwards.
    """
    model.env.restore(tree["env"])
    restore_learner(model, tree)
    model._last_obs = tree["last_observation"]
    model._last_episode_starts = tree["last_episode_starts"]
    model.ep_info_buffer = deque(tree["episodes"], maxlen=model._stats_window_size)
    model.ep_success_buffer = deque(maxlen=model._stats_window_size)
    if "replay" in tree:
        buffer, replay = model.replay_buffer, tree["replay"]
        for name, values in replay["arrays"].items():
            getattr(buffer, name)[: len(values)] = values
        buffer.pos, buffer.full = replay["pos"], replay["full"]
    model.restore_own(tree["own"])
    _restore_random(model, tree["random"])


def restore_learner(model: BaseAlgorithm, tree: Tree) -> None:
    """Bring a model to a ``learner_state``."""
    model.policy.load_state_dict(_to_torch(tree["policy"]))
    if "log_ent_coef" in tree:
        model.log_ent_coef.data.copy_(torch.from_numpy(tree["log_ent_coef"]))
    for optimizer, state in zip(_optimizers(model), tree["optimizers"], strict=True):
        state["state"] = {int(key): _to_torch(value) for key, value in state["state"].items()}
        optimizer.load_state_dict(state)
    for name, value in tree["counters"].items():
        setattr(model, name, value)


def _optimizers(model: BaseAlgorithm) -> list[torch.optim.Optimizer]:
    if isinstance(model, SAC):
        own = [model.actor.optimizer, model.critic.optimizer]
        return own + ([model.ent_coef_optimizer] if model.ent_coef_optimizer is not None else [])
    return [model.policy.optimizer]


def _to_numpy(node: Any) -> Any:  # noqa: ANN401
    if isinstance(node, dict):
        return {key: _to_numpy(value) for key, value in node.items()}
    if isinstance(node, list | tuple):
        return [_to_numpy(value) for value in node]
    return node.detach().cpu().numpy().copy() if isinstance(node, torch.Tensor) else node


def _to_torch(node: Any) -> Any:  # noqa: ANN401
    if isinstance(node, dict):
        return {key: _to_torch(value) for key, value in node.items()}
    return torch.from_numpy(node.copy()) if isinstance(node, np.ndarray) else node


def _replay_state(buffer: Any) -> Tree:  # noqa: ANN401
    filled = buffer.buffer_size if buffer.full else buffer.pos
    arrays = {name: getattr(buffer, name)[:filled] for name in _REPLAY}
    return {"pos": buffer.pos, "full": buffer.full, "arrays": arrays}


def _random_state(model: BaseAlgorithm) -> Tree:
    kind, keys, position, has_gauss, gauss = np.random.get_state(legacy=True)  # noqa: NPY002
    version, words, gauss_next = random.getstate()
    return {
        "torch": torch.get_rng_state().numpy(),
        "numpy": [str(kind), np.asarray(keys), int(position), int(has_gauss), float(gauss)],
        "python": [version, list(words), gauss_next],
        "actions": model.action_space.np_random.bit_generator.state,
    }


def _restore_random(model: BaseAlgorithm, state: Tree) -> None:
    torch.set_rng_state(torch.from_numpy(state["torch"]))
    np.random.set_state(tuple(state["numpy"]))  # noqa: NPY002
    version, words, gauss_next = state["python"]
    random.setstate((version, tuple(words), gauss_next))
    model.action_space.np_random.bit_generator.state = state["actions"]
