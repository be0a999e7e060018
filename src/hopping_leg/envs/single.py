"""One leg as a Gymnasium environment."""

import math
from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt

from hopping_leg.envs.observation import Array32
from hopping_leg.envs.options import TaskConfig
from hopping_leg.envs.paper_reward import paper_reward
from hopping_leg.envs.render import Camera, Image
from hopping_leg.envs.rewards import Reward
from hopping_leg.envs.step import Step
from hopping_leg.envs.task import HoppingTask
from hopping_leg.robot import Robot, load_robot

_LARGEST = float(np.finfo(np.float32).max)


def observations(task: HoppingTask) -> "gymnasium.spaces.Box[np.float32]":
    """Return the space of a task's observations; unbounded, as joints may pass their limits."""
    return gymnasium.spaces.Box(-_LARGEST, _LARGEST, (task.observation.size,), np.float32)


ACTIONS = gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32)
"""Hip and knee torque over ``TaskConfig.action_torque``."""


class HoppingEnv(gymnasium.Env[Array32, npt.NDArray[np.float32]]):
    """One leg hopping to commanded heights, ``HoppingLeg-v0``.

    A thin view of a ``HoppingTask`` with one leg. ``info`` holds ``base_height`` and ``command``,
    m, ``reward_terms``, the reward's unweighted terms by name, and, in a step that passes an
    in-flight apex, ``apex_height`` and ``apex_error`` (its height above the command), m.

    Args:
        robot: The leg, or its name, or the path of its TOML file.
        options: The learning problem.
        reward: Judges every tick; the paper's if None.
        render_mode: ``"rgb_array"`` or None.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 200}  # noqa: RUF012

    def __init__(
        self,
        robot: Robot | str = "legv2-paper",
        options: TaskConfig = TaskConfig(),  # noqa: B008
        reward: Reward | None = None,
        render_mode: str | None = None,
    ) -> None:
        leg = load_robot(robot) if isinstance(robot, str) else robot
        self.render_mode = render_mode
        self.metadata = {**type(self).metadata, "render_fps": round(options.rate)}
        rng = np.random.default_rng(0)
        self.task = HoppingTask(
            leg, 1, options, reward or paper_reward(leg), rng, threads=1, autoreset=False
        )
        self.observation_space, self.action_space = observations(self.task), ACTIONS
        self._terms = self.task.reward.names
        self._seeded = False
        self._camera: Camera | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array32, dict[str, Any]]:
        """Begin an episode; a ``seed`` restarts all randomness."""
        super().reset(seed=seed)
        if seed is None and self._seeded:
            observation = self.task.reset()
        else:
            observation = self.task.reseed(self.np_random)
            self._seeded = True
        task = self.task
        info = {"base_height": task.legs.height.item(), "command": task.command.item()}
        return observation[0], info

    def step(
        self, action: npt.NDArray[np.float32]
    ) -> tuple[Array32, float, bool, bool, dict[str, Any]]:
        """Act for one control period."""
        step = self.task.step(action[None])
        return (
            step.observation[0],
            step.reward.item(),
            step.terminated.item(),
            step.truncated.item(),
            self._info(step),
        )

    def _info(self, step: Step) -> dict[str, Any]:
        info: dict[str, Any] = {
            "base_height": step.height.item(),
            "command": self.task.command.item(),
            "reward_terms": dict(zip(self._terms, step.terms[0].tolist(), strict=True)),
        }
        apex_height = step.apex_height.item()
        if not math.isnan(apex_height):
            info["apex_height"], info["apex_error"] = apex_height, step.apex_error.item()
        return info

    def render(self) -> Image | None:
        """Return a picture from the side, (480, 640, 3), in mode ``"rgb_array"``."""
        if self.render_mode is None:
            return None
        if self._camera is None:
            self._camera = Camera(self.task.legs)
        return self._camera.picture()

    def close(self) -> None:
        """Free the renderer."""
        if self._camera is not None:
            self._camera.close()
            self._camera = None
