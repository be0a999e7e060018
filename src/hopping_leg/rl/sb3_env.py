"""The hopping task as stable-baselines3 wants it: one VecEnv over many legs stepped at once."""

from typing import Any

import gymnasium
import numpy as np
from stable_baselines3.common.vec_env import VecEnv

from hopping_leg.arrays import Array, Array32, BoolArray, Stateful
from hopping_leg.envs.task import HoppingTask, Step


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
        self._terms, self._steps = np.zeros(len(task.reward.names)), 0
        self._nothing: list[dict[str, Any]] = [{} for _ in range(task.count)]
        self._action: Array32 = np.zeros((task.count, 2), np.float32)

    def take_reward_terms(self) -> dict[str, float]:
        """Return the reward's unweighted terms by name, mean per tick since the last call."""
        if not self._steps:
            return {}
        means = self._terms / self._steps
        self._terms, self._steps = np.zeros_like(self._terms), 0
        return dict(zip(self.task.reward.names, means.tolist(), strict=True))

    def reset(self) -> Array32:
        """Begin new episodes of all legs."""
        return self._observation(self.task.reset())

    def step_async(self, actions: Array32) -> None:
        """Keep the actions, (n, 2), for ``step_wait``."""
        self._action = actions

    def step_wait(self) -> tuple[Array32, Array, BoolArray, list[dict[str, Any]]]:
        """Step all legs; legs whose episode ended have begun the next."""
        step = self.task.step(self._action)
        self._terms += np.mean(step.terms, axis=0)
        self._steps += 1
        done = step.terminated | step.truncated
        infos = self._end_episodes(step, done) if done.any() else self._nothing
        return self._observation(step.observation), step.reward, done, infos

    def _end_episodes(self, step: Step, done: BoolArray) -> list[dict[str, Any]]:
        assert step.final_observation is not None
        assert step.final_privileged is not None
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for leg in np.flatnonzero(done):
            final = step.final_observation[leg], step.final_privileged[leg]
            infos[leg] = {
                "terminal_observation": np.concatenate(final),
                "TimeLimit.truncated": bool(step.truncated[leg]),
            }
        return infos

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
