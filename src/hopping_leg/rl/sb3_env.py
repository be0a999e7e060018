"""The hopping task as stable-baselines3 wants it: one VecEnv over many legs stepped at once."""

import time
from collections import deque
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
from stable_baselines3.common.vec_env import VecEnv

from hopping_leg.arrays import Array, Array32, BoolArray
from hopping_leg.controllers.shooting import Shooting
from hopping_leg.envs.task import HoppingTask, Step

_RECENT_HOPS = 500
"""Hops that the live numbers look back over."""


class TaskVecEnv(VecEnv):  # type: ignore[misc]
    """A ``HoppingTask`` for stable-baselines3.

    Observations are (n, size); with ``privileged`` the true state follows in the same
    rows, for critics that may see it in training, and then what a ``teacher`` would do, (n, 2).

    Attributes:
        correct: Changes commands, m, (n,), to those that the teacher is asked for.
    """

    def __init__(
        self, task: HoppingTask, *, privileged: bool = False, teacher: Shooting | None = None
    ) -> None:
        self.task, self._privileged, self.teacher = task, privileged, teacher
        self.correct: Callable[[Array], Array] = lambda command: command
        size = task.observation.size + (task.privileged_size if privileged else 0)
        if teacher is not None:
            size += 2
            teacher.watch(task.legs)
            teacher.reset(task.count)
        space = gymnasium.spaces.Box(-np.inf, np.inf, (size,), np.float32)
        self.render_mode = None
        super().__init__(task.count, space, gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32))
        self.hops = 0
        """In-flight apexes so far, of all legs."""
        self._recent: deque[tuple[float, float]] = deque(maxlen=_RECENT_HOPS)
        self._terms, self._steps = np.zeros(len(task.reward.names)), 0
        self._return = np.zeros(task.count)
        self._length = np.zeros(task.count, np.int64)
        self._started = time.monotonic()
        self._nothing: list[dict[str, Any]] = [{} for _ in range(task.count)]
        self._action: Array32 = np.zeros((task.count, 2), np.float32)

    @property
    def apex_error(self) -> float:
        """Mean |apex - command| over the latest hops of all legs, m; NaN before the first."""
        _, errors = self.recent_hops
        return float(np.mean(np.abs(errors))) if len(errors) else float("nan")

    @property
    def recent_hops(self) -> tuple[Array, Array]:
        """Commands of the latest hops and apex minus command, m, (hops,) each."""
        commands, errors = np.array(self._recent).reshape(-1, 2).T
        return commands, errors

    def take_reward_terms(self) -> dict[str, float]:
        """Return the reward's unweighted terms by name, mean per tick since the last call."""
        if not self._steps:
            return {}
        means = self._terms / self._steps
        self._terms, self._steps = np.zeros_like(self._terms), 0
        return dict(zip(self.task.reward.names, means.tolist(), strict=True))

    def reset(self) -> Array32:
        """Begin new episodes of all legs."""
        self._return[:], self._length[:] = 0.0, 0
        seen = self.task.reset()
        if self.teacher is not None:
            self.teacher.reset(self.num_envs)
        return self._observation(seen)

    def step_async(self, actions: Array32) -> None:
        """Keep the actions, (n, 2), for ``step_wait``."""
        self._action = actions

    def step_wait(self) -> tuple[Array32, Array, BoolArray, list[dict[str, Any]]]:
        """Step all legs; legs whose episode ended have begun the next."""
        command = self.task.command.copy()
        step = self.task.step(self._action)
        self._terms += np.mean(step.terms, axis=0)
        self._steps += 1
        self._return += step.reward
        self._length += 1
        if step.apex_error is not None:
            (legs,) = np.nonzero(~np.isnan(step.apex_error))
            self.hops += len(legs)
            self._recent.extend(zip(command[legs], step.apex_error[legs], strict=True))
        done = step.terminated | step.truncated
        if self.teacher is not None:
            scale = self.task.options.action_torque
            self.teacher.take_applied(self._action.clip(-1, 1) * scale)
            self.teacher.begin(np.flatnonzero(done))
        infos = self._end_episodes(step, done) if done.any() else self._nothing
        return self._observation(step.observation), step.reward, done, infos

    def _end_episodes(self, step: Step, done: BoolArray) -> list[dict[str, Any]]:
        assert step.final_observation is not None
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for leg in np.flatnonzero(done):
            final: Any = step.final_observation[leg]
            if self._privileged:
                assert step.final_privileged is not None
                nothing = np.zeros(2 if self.teacher is not None else 0, np.float32)
                final = np.concatenate([final, step.final_privileged[leg], nothing])
            infos[leg] = {
                "terminal_observation": final,
                "TimeLimit.truncated": bool(step.truncated[leg]),
                "episode": {
                    "r": float(self._return[leg]),
                    "l": int(self._length[leg]),
                    "t": time.monotonic() - self._started,
                },
            }
        self._return[done], self._length[done] = 0.0, 0
        return infos

    def _observation(self, seen: Array32) -> Array32:
        if not self._privileged:
            return seen
        parts = [seen, self.task.privileged()]
        if self.teacher is not None:
            torque = self.teacher.torque(self.correct(self.task.command))
            parts.append((torque / self.task.options.action_torque).clip(-1, 1).astype(np.float32))
        return np.concatenate(parts, axis=1)

    def state(self) -> dict[str, Any]:
        """Return everything needed to go on exactly from here."""
        return {
            "task": self.task.state(),
            "teacher": self.teacher.state() if self.teacher else {},
            "hops": self.hops,
            "recent": np.array(self._recent).reshape(-1, 2),
            "return": self._return.copy(),
            "length": self._length.copy(),
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Go on from a ``state``."""
        self.task.restore(state["task"])
        if self.teacher is not None:
            self.teacher.restore(state["teacher"])
        self.hops = state["hops"]
        self._recent = deque(map(tuple, state["recent"].tolist()), maxlen=_RECENT_HOPS)
        self._return[:], self._length[:] = state["return"], state["length"]

    def close(self) -> None:
        """Do nothing: the legs hold no resources beyond memory."""

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:  # noqa: ANN401
        """Return an attribute once per selected leg."""
        return [getattr(self, attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, *_args: Any, **_kwargs: Any) -> None:  # noqa: ANN401
        """Refuse: legs have no attributes of their own."""
        raise NotImplementedError("legs have no attributes of their own; set them on the task")

    def env_method(self, *_args: Any, **_kwargs: Any) -> list[Any]:  # noqa: ANN401
        """Refuse: legs have no methods of their own."""
        raise NotImplementedError("legs have no methods of their own; call the task's")

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:  # noqa: ANN401
        """Return False per selected leg."""
        return [False] * len(list(self._get_indices(indices)))
