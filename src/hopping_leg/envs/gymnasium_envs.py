"""The task as Gymnasium environments: one leg, and many as a vector environment.

Both are ``HoppingLeg-v0``, registered by ``import hopping_leg``, and thin views of a
``HoppingTask``; the same seed gives the same bytes.
"""

import math
from typing import Any

import gymnasium
import mujoco
import numpy as np
import numpy.typing as npt
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from hopping_leg.arrays import Array, Array32, BoolArray
from hopping_leg.envs import rewards, task_config
from hopping_leg.envs.paper_reward import paper_reward
from hopping_leg.envs.task import HoppingTask, Step
from hopping_leg.errors import UsageError
from hopping_leg.robot import DEFAULT_ROBOT, Robot, build_model, load_robot
from hopping_leg.sim import LegSimulator

Image = npt.NDArray[np.uint8]

ACTIONS = gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32)
"""Hip and knee torque over ``TaskConfig.action_torque``."""

_LARGEST = float(np.finfo(np.float32).max)


class Camera:
    """Draws one of many legs from the side; takes OpenGL up with its first picture."""

    def __init__(self, legs: LegSimulator) -> None:
        self.legs = legs
        self._model = build_model(legs.robot)
        self._data = mujoco.MjData(self._model)
        self._renderer: Any = None

    def picture(self, leg: int = 0) -> Image:
        """Return an RGB picture of a leg, (480, 640, 3); a UsageError where there is no OpenGL."""
        if self._renderer is None:
            try:
                self._renderer = mujoco.Renderer(self._model, height=480, width=640)
            except Exception as error:  # each OpenGL backend raises its own kind
                raise UsageError(
                    f"Pictures need OpenGL, which is not available here ({error}); install a driver"
                    " and set MUJOCO_GL=egl or MUJOCO_GL=osmesa, or do not render."
                ) from error
        self._data.qpos[0] = self.legs.height[leg]
        self._data.qpos[1:] = self.legs.q[leg]
        mujoco.mj_forward(self._model, self._data)
        self._renderer.update_scene(self._data, camera="side")
        image: Image = self._renderer.render()
        return image

    def close(self) -> None:
        """Free the OpenGL context."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None


def _make_task(
    robot: Robot | str,
    num_envs: int,
    options: task_config.TaskConfig,
    reward: rewards.Reward | None,
    threads: int,
    *,
    autoreset: bool,
) -> HoppingTask:
    leg = load_robot(robot) if isinstance(robot, str) else robot
    terms, rng = reward or paper_reward(leg), np.random.default_rng(0)
    return HoppingTask(leg, num_envs, options, terms, rng, threads, autoreset=autoreset)


def _observation_space(task: HoppingTask) -> "gymnasium.spaces.Box[np.float32]":
    return gymnasium.spaces.Box(-_LARGEST, _LARGEST, (task.observation.size,), np.float32)


class HoppingEnv(gymnasium.Env[Array32, Array32]):
    """One leg hopping to commanded heights.

    ``info`` holds ``base_height`` and ``command``, m, ``reward_terms``, the reward's unweighted
    terms by name, and, in a step that passes an in-flight apex, ``apex_height`` and ``apex_error``
    (its height above the command), m.

    The robot may be a name or the path of a TOML file; the reward is the paper's if None; the
    render mode is ``"rgb_array"`` or None.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 200}  # noqa: RUF012

    def __init__(
        self,
        robot: Robot | str = DEFAULT_ROBOT,
        options: task_config.TaskConfig = task_config.TaskConfig(),  # noqa: B008
        reward: rewards.Reward | None = None,
        render_mode: str | None = None,
    ) -> None:
        self.render_mode = render_mode
        self.metadata = {**type(self).metadata, "render_fps": round(options.rate)}
        self.task = _make_task(robot, 1, options, reward, threads=1, autoreset=False)
        self.observation_space, self.action_space = _observation_space(self.task), ACTIONS
        self._camera, self._seeded = Camera(self.task.legs), False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array32, dict[str, Any]]:
        """Begin an episode; a ``seed`` restarts all randomness."""
        super().reset(seed=seed)
        again, self._seeded = self._seeded and seed is None, True
        task = self.task
        observation = task.reset() if again else task.reseed(self.np_random)
        info = {"base_height": task.legs.height.item(), "command": task.command.item()}
        return observation[0], info

    def step(self, action: Array32) -> tuple[Array32, float, bool, bool, dict[str, Any]]:
        """Act for one control period."""
        step = self.task.step(action[None])
        info: dict[str, Any] = {
            "base_height": step.height.item(),
            "command": self.task.command.item(),
            "reward_terms": dict(zip(self.task.reward.names, step.terms[0].tolist(), strict=True)),
        }
        if not math.isnan(apex_height := step.apex_height.item()):
            info["apex_height"], info["apex_error"] = apex_height, step.apex_error.item()
        ended = step.terminated.item(), step.truncated.item()
        return step.observation[0], step.reward.item(), *ended, info

    def render(self) -> Image | None:
        """Return a picture from the side, (480, 640, 3), in mode ``"rgb_array"``."""
        return None if self.render_mode is None else self._camera.picture()

    def close(self) -> None:
        """Free the renderer."""
        self._camera.close()


class HoppingVectorEnv(gymnasium.vector.VectorEnv[Array32, Array32, Any]):
    """Legs hopping to commanded heights, on the batched simulation.

    Episodes restart in the step that ends them (``AutoresetMode.SAME_STEP``):
    ``info["final_obs"]`` and ``info["final_info"]`` then hold what was seen last. Arguments are
    those of ``HoppingEnv``; the threads, 0 for one per core, change no result.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012
        **HoppingEnv.metadata,
        "autoreset_mode": AutoresetMode.SAME_STEP,
    }

    def __init__(
        self,
        num_envs: int = 1,
        robot: Robot | str = DEFAULT_ROBOT,
        options: task_config.TaskConfig = task_config.TaskConfig(),  # noqa: B008
        reward: rewards.Reward | None = None,
        threads: int = 0,
        render_mode: str | None = None,
    ) -> None:
        self.num_envs, self.render_mode = num_envs, render_mode
        self.metadata = {**type(self).metadata, "render_fps": round(options.rate)}
        self.task = _make_task(robot, num_envs, options, reward, threads, autoreset=True)
        self.single_observation_space = _observation_space(self.task)
        self.single_action_space = ACTIONS
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(ACTIONS, num_envs)
        self._all = np.ones(num_envs, np.bool_)
        self._camera, self._seeded = Camera(self.task.legs), False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array32, dict[str, Any]]:
        """Begin an episode in every leg; a ``seed`` restarts all randomness."""
        super().reset(seed=seed)
        again, self._seeded = self._seeded and seed is None, True
        observation = self.task.reset() if again else self.task.reseed(self.np_random)
        return observation, self._masked(self._standing(), self._all)

    def step(self, actions: Array32) -> tuple[Array32, Array, BoolArray, BoolArray, dict[str, Any]]:
        """Act for one control period in every leg; actions are (n, 2)."""
        step = self.task.step(actions)
        return step.observation, step.reward, step.terminated, step.truncated, self._info(step)

    def _standing(self) -> dict[str, Any]:
        return {"base_height": self.task.legs.height.copy(), "command": self.task.command.copy()}

    def _info(self, step: Step) -> dict[str, Any]:
        apexes = {"apex_height": step.apex_height, "apex_error": step.apex_error}
        info = self._masked(self._standing(), self._all)
        info |= self._masked(apexes, ~np.isnan(step.apex_height))
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
        return tuple(self._camera.picture(leg).copy() for leg in range(self.num_envs))

    def close_extras(self, **kwargs: Any) -> None:  # noqa: ANN401
        """Free the renderer."""
        self._camera.close()
