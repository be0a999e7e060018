"""Many legs as one Gymnasium vector environment, on the batched simulation."""

from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from hopping_leg.arrays import Array, BoolArray
from hopping_leg.envs.observation import Array32
from hopping_leg.envs.options import TaskConfig
from hopping_leg.envs.paper_reward import paper_reward
from hopping_leg.envs.render import Camera, Image
from hopping_leg.envs.rewards import Reward
from hopping_leg.envs.single import ACTIONS, observations
from hopping_leg.envs.step import Step
from hopping_leg.envs.task import HoppingTask
from hopping_leg.robot import Robot, load_robot


class HoppingVectorEnv(gymnasium.vector.VectorEnv[Array32, npt.NDArray[np.float32], Any]):
    """Legs hopping to commanded heights, the vector entry point of ``HoppingLeg-v0``.

    A thin view of a ``HoppingTask``. Episodes restart in the step that ends them
    (``AutoresetMode.SAME_STEP``): ``info["final_obs"]`` and ``info["final_info"]`` then hold what
    was seen last.

    Args:
        num_envs: Number of legs n.
        robot: The leg, or its name, or the path of its TOML file.
        options: The learning problem.
        reward: Judges every tick; the paper's if None.
        threads: Worker threads, 0 for one per core; results do not depend on it.
        render_mode: ``"rgb_array"`` or None.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012
        "render_modes": ["rgb_array"],
        "render_fps": 200,
        "autoreset_mode": AutoresetMode.SAME_STEP,
    }

    def __init__(
        self,
        num_envs: int = 1,
        robot: Robot | str = "legv2-paper",
        options: TaskConfig = TaskConfig(),  # noqa: B008
        reward: Reward | None = None,
        threads: int = 0,
        render_mode: str | None = None,
    ) -> None:
        leg = load_robot(robot) if isinstance(robot, str) else robot
        self.num_envs, self.render_mode = num_envs, render_mode
        self.metadata = {**type(self).metadata, "render_fps": round(options.rate)}
        judge, rng = reward or paper_reward(leg), np.random.default_rng(0)
        self.task = HoppingTask(leg, num_envs, options, judge, rng, threads)
        self.single_observation_space, self.single_action_space = observations(self.task), ACTIONS
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(ACTIONS, num_envs)
        self._all = np.ones(num_envs, np.bool_)
        self._seeded = False
        self._camera: Camera | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array32, dict[str, Any]]:
        """Begin an episode in every leg; a ``seed`` restarts all randomness."""
        super().reset(seed=seed)
        if seed is None and self._seeded:
            observation = self.task.reset()
        else:
            observation = self.task.reseed(self.np_random)
            self._seeded = True
        task = self.task
        return observation, self._masked(
            {"base_height": task.legs.height.copy(), "command": task.command.copy()}, self._all
        )

    def step(
        self, actions: npt.NDArray[np.float32]
    ) -> tuple[Array32, Array, BoolArray, BoolArray, dict[str, Any]]:
        """Act for one control period in every leg; actions are (n, 2)."""
        step = self.task.step(actions)
        return step.observation, step.reward, step.terminated, step.truncated, self._info(step)

    def _info(self, step: Step) -> dict[str, Any]:
        apexes = {"apex_height": step.apex_height, "apex_error": step.apex_error}
        now = {"base_height": self.task.legs.height.copy(), "command": self.task.command.copy()}
        info = self._masked(now, self._all) | self._masked(apexes, ~np.isnan(step.apex_height))
        if step.final_observation is None:
            return info
        ended = step.terminated | step.truncated
        last = np.full(self.num_envs, None, dtype=object)
        for leg in np.flatnonzero(ended):
            last[leg] = step.final_observation[leg]
        final = self._masked({"base_height": step.height}, ended)
        return info | self._masked({"final_obs": last, "final_info": final}, ended)

    @staticmethod
    def _masked(values: dict[str, Any], mask: BoolArray) -> dict[str, Any]:
        """Add to every entry the mask of the legs that have it, as Gymnasium asks for."""
        return values | {f"_{name}": mask for name in values}

    def render(self) -> tuple[Image, ...] | None:
        """Return a picture of every leg from the side in mode ``"rgb_array"``."""
        if self.render_mode is None:
            return None
        if self._camera is None:
            self._camera = Camera(self.task.legs)
        return tuple(self._camera.picture(leg).copy() for leg in range(self.num_envs))

    def close_extras(self, **kwargs: Any) -> None:  # noqa: ANN401
        """Free the renderer."""
        if self._camera is not None:
            self._camera.close()
            self._camera = None
