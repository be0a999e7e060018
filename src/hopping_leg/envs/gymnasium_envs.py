"""The task as Gymnasium environments: one leg, and many as a vector environment.

Both are ``HoppingLeg-v0``, registered by ``import hopping_leg``, and thin views of a
``HoppingTask``; the same seed gives the same bytes. Observations are float32, rewards float64, and
every array that is handed out is the caller's.
"""

import dataclasses
import functools
import math
from typing import Any

import gymnasium
import mujoco
import numpy as np
import numpy.typing as npt
from gymnasium.envs.registration import EnvSpec
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from hopping_leg.arrays import Array, Array32, BoolArray
from hopping_leg.envs.paper_reward import paper_reward
from hopping_leg.envs.rewards import Reward
from hopping_leg.envs.task import HoppingTask, Step
from hopping_leg.envs.task_config import TaskConfig
from hopping_leg.errors import UsageError, unknown_name
from hopping_leg.robot import DEFAULT_ROBOT, Robot, build_model, load_robot

Image = npt.NDArray[np.uint8]


class _TaskView:
    """What both environments are: a task, its spaces, its pictures, and whether it was seeded."""

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 200}  # noqa: RUF012
    np_random: np.random.Generator
    _spec: EnvSpec | None = None

    @property
    def spec(self) -> EnvSpec | None:
        """How it was made, with the episode's length in steps, which wrappers ask for."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        if spec is not None and spec.max_episode_steps is None:
            spec.max_episode_steps = self.task.episode_steps
        self._spec = spec

    def _open(
        self, robot: Robot | str, count: int, options: TaskConfig, reward: Reward | None,
        render_mode: str | None, threads: int, *, autoreset: bool,
    ) -> "tuple[Box[np.float32], Box[np.float32]]":  # fmt: skip
        """Make the task; return the spaces of a leg's observation and action."""
        if render_mode not in (None, *(valid := _TaskView.metadata["render_modes"])):
            raise UsageError(unknown_name("render mode", str(render_mode), valid))
        leg = load_robot(robot) if isinstance(robot, str) else robot
        self.render_mode = render_mode
        self.metadata = {**type(self).metadata, "render_fps": round(options.rate)}
        terms, rng = reward or paper_reward(leg), np.random.default_rng(0)
        self.task = HoppingTask(leg, count, options, terms, rng, threads, autoreset=autoreset)
        self._seeded, self._terms = False, [f"reward_{name}" for name in terms.names]
        seen = Box(-np.inf, np.inf, (self.task.observation.size,), np.float32)
        return seen, Box(-1.0, 1.0, (2,), np.float32)

    @functools.cached_property
    def _stage(self) -> tuple[mujoco.Renderer, mujoco.MjData]:
        model = build_model(self.task.robot)
        try:
            return mujoco.Renderer(model, height=480, width=640), mujoco.MjData(model)
        except Exception as error:  # each OpenGL backend raises its own kind
            raise UsageError(
                f"Pictures need OpenGL, which is not available here ({error}); install a driver"
                " and set MUJOCO_GL=egl or MUJOCO_GL=osmesa, or do not render."
            ) from error

    def _picture(self, leg: int = 0) -> Image:
        """Return an RGB picture from the side, (480, 640, 3); a UsageError without OpenGL."""
        (renderer, data), legs = self._stage, self.task.legs
        data.qpos[0], data.qpos[1:] = legs.height[leg], legs.q[leg]
        mujoco.mj_forward(renderer.model, data)
        renderer.update_scene(data, camera="side")
        image: Image = renderer.render()
        return image

    def close_extras(self, **kwargs: Any) -> None:  # noqa: ANN401
        """Free the renderer."""
        if "_stage" in vars(self):
            self._stage[0].close()
            del self._stage

    def _begin(self, seed: int | None, command: Array | None) -> Array32:
        again, self._seeded = self._seeded and seed is None, True
        task = self.task
        return task.reset(None, command) if again else task.reseed(self.np_random, command)


def _asked(options: dict[str, Any] | None, count: int) -> Array | None:
    """Return the commands that a reset is asked for, m, (count,), None to draw them."""
    for name in options or {}:
        if name != "command":
            raise UsageError(unknown_name("option of reset", str(name), ["command"]))
    if (command := (options or {}).get("command")) is None:
        return None
    heights = np.asarray(command, np.float64)
    if heights.shape not in ((), (count,)) or not ((heights > 0) & (heights < np.inf)).all():
        raise UsageError(
            f"'command' must be a positive height in m, one for all or for each of {count} legs,"
            f" not {command!r:.60}."
        )
    return np.broadcast_to(heights, count)


class HoppingEnv(_TaskView, gymnasium.Env[Array32, Array32]):
    """One leg hopping to commanded heights.

    ``info`` holds ``base_height`` and ``command``, that of the tick, m, ``reward_NAME``, each term
    of the reward unweighted, and, in a step that passes an in-flight apex, ``apex_height`` and
    ``apex_error`` (its height above the command), m.

    The robot may be a name or the path of a TOML file; the reward, of which the environment takes a
    copy, is the paper's if None; the render mode is ``"rgb_array"`` or None, else a UsageError.
    """

    def __init__(
        self,
        robot: Robot | str = DEFAULT_ROBOT,
        options: TaskConfig = TaskConfig(),  # noqa: B008
        reward: Reward | None = None,
        render_mode: str | None = None,
    ) -> None:
        self.observation_space, self.action_space = self._open(
            robot, 1, options, reward, render_mode, 1, autoreset=False
        )

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array32, dict[str, Any]]:
        """Begin an episode; a ``seed`` restarts all randomness.

        The option ``command`` is the episode's height, m; UsageError refuses any other.
        """
        command = _asked(options, 1)
        super().reset(seed=seed)
        seen, task = self._begin(seed, command)[0], self.task
        return seen, {"base_height": task.legs.height.item(), "command": task.command.item()}

    def step(self, action: Array32) -> tuple[Array32, float, bool, bool, dict[str, Any]]:
        """Act for one control period; UsageError refuses an action that is not two numbers."""
        step = self.task.step(np.asarray(action)[None])
        info = dict(zip(self._terms, step.terms[0].tolist(), strict=True))
        info |= {"base_height": step.height.item(), "command": step.command.item()}
        if not math.isnan(apex_height := step.apex_height.item()):
            info["apex_height"], info["apex_error"] = apex_height, step.apex_error.item()
        ended = step.terminated.item(), step.truncated.item()
        return step.observation[0], step.reward.item(), *ended, info

    def render(self) -> Image | None:
        """Return a picture from the side, (480, 640, 3), in mode ``"rgb_array"``."""
        return None if self.render_mode is None else self._picture()

    close = _TaskView.close_extras


class HoppingVectorEnv(_TaskView, gymnasium.vector.VectorEnv[Array32, Array32, Any]):
    """Legs hopping to commanded heights, on the batched simulation.

    Arguments are those of ``HoppingEnv``; the threads, 0 for one per core, change no result. Where
    an episode ended, the next one begins by ``autoreset_mode``: in the step after it, whose action
    counts for nothing, or in the same step, whose ``info["final_obs"]`` and ``info["final_info"]``
    hold what ``HoppingEnv`` would have returned. Episodes are no longer than ``max_episode_steps``,
    as with Gymnasium's own ``TimeLimit``.

    Raises:
        UsageError: The mode of rendering or autoreset is unknown, or an episode has no steps.
    """

    def __init__(
        self,
        num_envs: int = 1,
        robot: Robot | str = DEFAULT_ROBOT,
        options: TaskConfig = TaskConfig(),  # noqa: B008
        reward: Reward | None = None,
        threads: int = 0,
        render_mode: str | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        max_episode_steps: int | None = None,
    ) -> None:
        mode = AutoresetMode(autoreset_mode)
        if mode is AutoresetMode.DISABLED:
            raise UsageError("The autoreset mode must be NextStep or SameStep, not Disabled.")
        if max_episode_steps is not None:
            longest = min(options.episode, max_episode_steps / options.rate)
            options = dataclasses.replace(options, episode=longest)
        self.num_envs = num_envs
        self.single_observation_space, self.single_action_space = self._open(
            robot, num_envs, options, reward, render_mode, threads,
            autoreset=mode is AutoresetMode.SAME_STEP,
        )  # fmt: skip
        self.autoreset_mode = self.metadata["autoreset_mode"] = mode
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._ended = np.zeros(num_envs, np.bool_)  # legs that wait for their next episode

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array32, dict[str, Any]]:
        """Begin an episode in every leg; a ``seed`` restarts all randomness, what differs included.

        The option ``command`` is the episodes' height, m, or (n,) of them; UsageError refuses any
        other.
        """
        command = _asked(options, self.num_envs)
        super().reset(seed=seed)
        seen, task = self._begin(seed, command), self.task
        self._ended[:] = False
        standing = {"base_height": task.legs.height.copy(), "command": task.command.copy()}
        return seen, self._masked(standing, ~self._ended)

    def step(self, actions: Array32) -> tuple[Array32, Array, BoolArray, BoolArray, dict[str, Any]]:
        """Act for one control period; UsageError refuses actions not finite or not (n, 2)."""
        step = self.task.step(np.asarray(actions))
        seen, reward = step.observation, step.reward
        terminated, truncated = step.terminated.copy(), step.truncated.copy()
        new = self._ended
        if new.any():
            seen = self.task.reset(np.flatnonzero(new))
            reward[new], terminated[new], truncated[new] = 0.0, False, False
        if self.task.autoreset:
            new = terminated | truncated
        else:
            self._ended = terminated | truncated
        command = np.where(new, self.task.command, step.command)
        standing = {"base_height": self.task.legs.height.copy(), "command": command}
        info = self._masked(standing, np.ones(self.num_envs, np.bool_))
        info |= self._of_tick(step, ~new)
        if step.final_observation is not None:
            last = np.full(self.num_envs, None, dtype=object)
            for leg in np.flatnonzero(new):
                last[leg] = step.final_observation[leg].copy()
            final = self._masked({"base_height": step.height, "command": step.command}, new)
            final |= self._of_tick(step, new)
            info |= self._masked({"final_obs": last, "final_info": final}, new)
        return seen, reward, terminated, truncated, info

    def _of_tick(self, step: Step, legs: BoolArray) -> dict[str, Any]:
        """Return rewards' terms and apexes of some legs."""
        terms = dict(zip(self._terms, step.terms.T.copy(), strict=True))
        apexes = {"apex_height": step.apex_height.copy(), "apex_error": step.apex_error.copy()}
        return self._masked(terms, legs) | self._masked(apexes, legs & ~np.isnan(step.apex_height))

    @staticmethod
    def _masked(values: dict[str, Any], mask: BoolArray) -> dict[str, Any]:
        """Add to every entry the mask of the legs that have it, as Gymnasium asks for."""
        return values | {f"_{name}": mask.copy() for name in values}

    def render(self) -> tuple[Image, ...] | None:
        """Return a picture of every leg from the side in mode ``"rgb_array"``."""
        if self.render_mode is None:
            return None
        return tuple(self._picture(leg).copy() for leg in range(self.num_envs))
