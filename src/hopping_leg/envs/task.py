"""The learning problem for many legs at once: observation, reward, commands, episodes."""

from typing import Any, NamedTuple

import numpy as np

from hopping_leg.arrays import Array, BoolArray, IntArray
from hopping_leg.envs.observation import (
    PRIVILEGED,
    Array32,
    make_observation,
    privileged_observation,
    sample_scaling,
)
from hopping_leg.envs.reset import ResetSampler
from hopping_leg.envs.rewards import Reward, Transition
from hopping_leg.envs.task_config import TaskConfig
from hopping_leg.hop_detection import at_apex
from hopping_leg.robot.parameters import Robot
from hopping_leg.sim import Measurement, MujocoSimulator, Plant, randomization


class Step(NamedTuple):
    """Outcome of one tick of n legs; legs whose episode ended have already begun the next."""

    observation: Array32
    """Seen after the tick, (n, size)."""
    reward: Array
    """(n,)."""
    terminated: BoolArray
    """Episode over because the leg fell; never by default, (n,)."""
    truncated: BoolArray
    """Episode over because its time was up, (n,)."""
    apex_error: Array
    """Apex height minus command where a leg just passed an in-flight apex, else NaN, m, (n,)."""
    apex_height: Array
    """Height of that apex, else NaN, m, (n,)."""
    height: Array
    """Base height at the end of the tick, before any restart, m, (n,)."""
    terms: Array
    """Reward terms in the order of the reward's ``names``, (n, k)."""
    final_observation: Array32 | None
    """Observations before the restart, (n, size), where any episode ended."""
    final_privileged: Array32 | None
    """True states before the restart, (n, privileged_size), where any episode ended."""


class HoppingTask:
    """n legs learning to hop; the only place where observation and reward are put together.

    Args:
        robot: The leg.
        count: Number of legs n.
        options: The learning problem.
        reward: Judges every tick.
        rng: Source of all randomness; results do not depend on the number of threads.
        threads: Worker threads, 0 for one per core.
        autoreset: Begin the next episode within the tick that ends one; otherwise the leg goes on
            until ``reset``.
    """

    def __init__(
        self,
        robot: Robot,
        count: int,
        options: TaskConfig,
        reward: Reward,
        rng: np.random.Generator,
        threads: int = 0,
        *,
        autoreset: bool = True,
    ) -> None:
        self.autoreset = autoreset
        self.robot, self.count, self.options, self.reward = robot, count, options, reward
        noise, self._rng, draws = rng.spawn(3)
        self._draw_seed, self._draw = int(draws.integers(2**62)), 0
        self._numbers = np.zeros((count, len(options.randomised)))
        self.legs = MujocoSimulator(
            robot, count, rate=options.rate, timestep=options.timestep, threads=threads
        )
        if options.randomize_from_start:
            self.randomize()
        self.plant = Plant(self.legs, options.disturbance, options.soft_limits, noise)
        self.observation = make_observation(robot, options, count)
        self._scaling = sample_scaling(robot, options)
        self._reset_sampler = ResetSampler(robot, options)
        self._torque = np.tile(options.action_torque, (count, 1))
        self._lowest, self._highest = np.full((count, 2), -1.0), np.full((count, 2), 1.0)
        self._horizon = max(1, round(options.episode * options.rate))
        self._never = np.zeros(count, np.bool_)
        self._nan = np.full(count, np.nan)
        for constant in (self._never, self._nan):
            constant.flags.writeable = False
        self.command = np.empty(count)
        self._tick = 0
        self._end = np.empty(count, np.int64)
        self._switch = np.full(count, np.iinfo(np.int64).max)
        self._last = np.zeros((count, 2))
        self._rises = np.zeros(count, np.bool_)
        self.reset()

    def randomize(self, draw: int = 1) -> None:
        """Let every leg go on with numbers of its own, if the task's options let legs differ.

        Args:
            draw: Each gives other numbers, always the same; those of the present one stay.
        """
        ranges = self.options.randomised
        if not ranges or draw == self._draw:
            return
        rng = np.random.default_rng([self._draw_seed, draw])
        drawn = randomization.sample(
            self.robot, ranges, self.count, rng, self.options.randomize_probability
        )
        same = np.diff(np.floor(self.options.nominal_fraction * np.arange(self.count + 1))) > 0
        variants = [self.robot if s else d for s, d in zip(same, drawn, strict=True)]
        self.legs.set_robots(variants)
        self._numbers, self._draw = randomization.normalized(self.robot, variants, ranges), draw

    @property
    def privileged_size(self) -> int:
        """Entries of the true state that a critic may see."""
        return PRIVILEGED + len(self.options.randomised)

    def reseed(self, rng: np.random.Generator) -> Array32:
        """Take all randomness from another source and begin anew; return what is seen."""
        noise, self._rng = rng.spawn(2)
        self.plant.channel.reseed(noise)
        return self.reset()

    def reset(self, ids: IntArray | None = None) -> Array32:
        """Begin new episodes.

        Args:
            ids: Which legs; all if None, and only then episodes are staggered.

        Returns:
            Observations of all legs, (n, size).
        """
        rows = np.arange(self.count) if ids is None else np.asarray(ids)
        self._begin(rows)
        if ids is None and self.options.random_episode_start:
            self._end[:] = self._tick + self._rng.integers(1, self._horizon + 1, self.count)
            self._plan()
        return self._see_anew(rows)

    def step(self, action: Array | Array32) -> Step:
        """Act for one control period.

        Args:
            action: Hip and knee torque over ``action_torque``, clipped to [-1, 1], (n, 2).
        """
        legs = self.legs
        taken = action.astype(np.float64)
        np.maximum(taken, self._lowest, out=taken)
        np.minimum(taken, self._highest, out=taken)
        height_before = legs.height.copy()
        self.plant.drive(taken * self._torque)
        apex, apex_height, apex_error = self._apexes(height_before)
        reward, terms = self.reward(
            Transition(
                legs.state, self.command, taken, self._last,
                apex, apex_height, legs.foot_clearance,
            )
        )  # fmt: skip
        self._last = taken
        return self._next(reward, terms, apex_error, apex_height)

    def _apexes(self, height_before: Array) -> tuple[BoolArray, Array, Array]:
        """Return which legs passed an in-flight apex, its height and error, m, (n,) each."""
        legs = self.legs
        rose, self._rises = self._rises, legs.height_rate > 0
        if not np.count_nonzero(rose > self._rises):
            return self._never, self._nan, self._nan
        apex = at_apex(rose, self._rises, legs.foot_clearance())
        height = np.where(apex, np.maximum(height_before, legs.height), np.nan)
        return apex, height, height - self.command

    def privileged(self) -> Array32:
        """Return what a critic may see in training, (n, size).

        The true state, then where the leg's own numbers lie in their ranges, if legs may differ; 0
        while they are alike.
        """
        result = np.empty((self.count, self.privileged_size), np.float32)
        privileged_observation(self.legs, self.command, self._scaling, out=result[:, :PRIVILEGED])
        if self._numbers.size:
            result[:, PRIVILEGED:] = self._numbers
        return result

    def state(self) -> dict[str, Any]:
        """Return everything needed to go on exactly from here, as arrays and plain values."""
        return {
            "physics": self.legs.batch.state.copy(),
            "waiting": self.legs.pending_torque.copy(),
            "channel": self.plant.channel.state(),
            "command": self.command.copy(),
            "tick": self._tick,
            "end": self._end.copy(),
            "switch": self._switch.copy(),
            "last_action": self._last.copy(),
            "rises": self._rises.copy(),
            "rng": self._rng.bit_generator.state,
            "reward": self.reward.state(),
            "observation": self.observation.state(),
        }

    def restore(self, state: dict[str, Any]) -> Array32:
        """Go on from a ``state``; return the observations, (n, size)."""
        self.legs.batch.state[:] = state["physics"]
        if "waiting" in state:
            self.legs.pending_torque = state["waiting"].copy()
        self.plant.channel.restore(state["channel"])
        self.command[:] = state["command"]
        self._tick = int(state["tick"])
        self._end[:] = state["end"]
        self._switch[:] = state["switch"]
        self._last, self._rises = np.array(state["last_action"]), np.array(state["rises"])
        self._rng.bit_generator.state = state["rng"]
        self.reward.restore(state["reward"])
        self.observation.restore(state["observation"])
        self._plan()
        self._samples = self.plant.samples(self.command)
        return self.observation.view(self._samples)

    @property
    def measurement(self) -> Measurement:
        """What the observation was made of: samples and their age."""
        return self.plant.channel.measurement(self._samples)

    def _see_anew(self, rows: IntArray) -> Array32:
        """Return what is seen once some legs have begun anew within the tick."""
        self._samples = self.plant.samples(self.command)
        self.observation.restart(rows, self._samples, self.plant.channel)
        return self.observation.view(self._samples)

    def _next(self, reward: Array, terms: Array, apex_error: Array, apex_height: Array) -> Step:
        """End the tick: episodes that are over, new commands, what is seen."""
        self._tick += 1
        if self._tick >= self._next_switch:
            self._change_commands()
        terminated = truncated = ended = self._never
        if self._tick >= self._next_end:
            truncated = ended = self._end <= self._tick
        if self.options.fall_clearance is not None:
            gap = np.minimum(self.legs.base_clearance(), self.legs.knee_clearance())
            terminated = gap < self.options.fall_clearance
            reward = reward - self.options.fall_penalty * terminated
            truncated = truncated & ~terminated
            ended = truncated | terminated
        self._samples = self.plant.samples(self.command)
        self.observation.advance(self._samples, self.plant.channel, self._last)
        observation = self.observation.view(self._samples)
        final_observation = final_privileged = None
        height = self.legs.height.copy()
        if self.autoreset and ended is not self._never and np.count_nonzero(ended):
            final_observation, final_privileged = observation, self.privileged()
            rows = np.flatnonzero(ended)
            self._begin(rows)
            observation = self._see_anew(rows)
        return Step(
            observation, reward, terminated, truncated, apex_error, apex_height, height, terms,
            final_observation, final_privileged,
        )  # fmt: skip

    def _begin(self, rows: IntArray) -> None:
        count = len(rows)
        self.command[rows] = self._draw_commands(count)
        height, q = self._reset_sampler.draw(self.command[rows], self._rng)
        self.legs.place(rows, height, q)
        self._end[rows] = self._tick + self._horizon
        self._last[rows], self._rises[rows] = 0.0, False
        self.reward.reset(rows)
        if self.options.command_resampling_time is not None:
            self._switch[rows] = self._tick + self._draw_holds(count)
        self.plant.channel.restart(rows, self.legs.q[rows], self.legs.qd[rows], self.command[rows])
        self._plan()

    def _plan(self) -> None:
        """Note the next tick at which an episode ends or a command changes."""
        self._next_end, self._next_switch = int(self._end.min()), int(self._switch.min())

    def _change_commands(self) -> None:
        due = np.flatnonzero(self._switch <= self._tick)
        self.command[due] = self._draw_commands(len(due))
        self._switch[due] = self._tick + self._draw_holds(len(due))
        self._plan()

    def _draw_commands(self, count: int) -> Array:
        if self.options.command_range is not None:
            low, high = self.options.command_range
            return low + (high - low) * self._rng.random(count) ** self.options.command_skew
        return self._rng.choice(self.options.commands, count)

    def _draw_holds(self, count: int) -> IntArray:
        """Return after how many ticks commands change, (count,)."""
        assert self.options.command_resampling_time is not None
        shortest, longest = (
            max(1, round(time * self.options.rate)) for time in self.options.command_resampling_time
        )
        return self._rng.integers(shortest, longest + 1, count)
