"""The learning problem for many legs at once: observation, reward, commands, episodes."""

import copy
import math
from collections.abc import Sequence
from typing import Any, NamedTuple, NoReturn

import numpy as np

from hopping_leg import errors, hop_detection
from hopping_leg.arrays import Array, Array32, BoolArray, IntArray, Stateful
from hopping_leg.controllers import robot_numbers
from hopping_leg.controllers.observation_history import AnyLeg
from hopping_leg.envs import rewards, task_config
from hopping_leg.envs.apex_reward import ballistic_apex
from hopping_leg.envs.initial_states import InitialStates
from hopping_leg.envs.observation import make_observation, sample_scaling
from hopping_leg.robot import Robot
from hopping_leg.sim import LegSimulator, Measurement, Plant, randomization
from hopping_leg.sim.any_leg import TaskLeg
from hopping_leg.sim.compiled import compiled

_RECENT = 500  # Hops that count as the latest
_PRIVILEGED = 16  # Entries of the true state, where all legs are the same
_CLEARANCE_GAIN = 10.0  # scale of clearances in there, 1/m
_EXCESS, _NEAR = 0.05, 0.02  # scales of what the apex in sight misses, m


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
    command: Array
    """Desired height in force during the tick, m, (n,)."""


class HoppingTask(Stateful):
    """n legs learning to hop; the only place where observation and reward are put together.

    All randomness comes from ``rng``; the threads, 0 for one per core, change no result. With
    ``autoreset`` the next episode begins within the tick that ends one, else with ``reset``. The
    reward is copied: what it remembers is of this task's legs alone. Where ``legs`` are given, one
    for each environment, they differ: what is told of them, what they are, and what is asked.
    """

    STATE = (
        *("command", "last_action", "reward", "observation", "plant.channel", "_recent_errors"),
        *("_tick", "_end", "_switch", "_rises", "_since_apex", "_rng", "_legs_seed"),
    )

    def __init__(
        self,
        robot: Robot,
        count: int,
        options: task_config.TaskConfig,
        reward: rewards.Reward,
        rng: np.random.Generator,
        threads: int = 0,
        *,
        autoreset: bool = True,
        legs: Sequence[TaskLeg] = (),
    ) -> None:
        self.autoreset, self.task_legs = autoreset, tuple(legs)
        self.robot, self.count, self.options = robot, count, options
        self.reward = copy.deepcopy(reward)
        noise, self._rng, numbers = rng.spawn(3)
        self._numbers = np.zeros((count, len(options.randomised)))
        self.legs = LegSimulator(
            robot, count, rate=options.rate, timestep=options.timestep, threads=threads,
            robots=[leg.true for leg in legs],
        )  # fmt: skip
        self._randomize(int(numbers.integers(2**62)))
        self._scaling = sample_scaling(robot, options)
        self._take(robot, noise)
        grid = options.episode_grid
        self.episode_steps = max(1, round(options.episode * options.rate / grid)) * grid
        self._never, self._nan = np.zeros(count, np.bool_), np.full(count, np.nan)
        for constant in (self._never, self._nan):
            constant.flags.writeable = False
        self.command = np.empty(count)
        self._torque = np.empty((count, 2))
        self._columns = columns = np.empty((6, count))
        self._true = columns[0], columns[3], columns[1:3].T, columns[4:6].T
        self.applied_torque = np.zeros((count, 2))
        """What the motors gave in the last control period, mean, N m, (n, 2)."""
        self._tick = 0
        self._end = np.empty(count, np.int64)
        self._switch = np.full(count, np.iinfo(np.int64).max)
        self.last_action, self._rises = np.zeros((count, 2)), np.zeros(count, np.bool_)
        self._since_apex = np.zeros(count)
        self._recent_errors: list[float] = []
        self.reset()

    def _take(self, robot: Robot, noise: np.random.Generator) -> None:
        options, count = self.options, self.count
        legs = self.task_legs or (TaskLeg(robot, robot, options.command_bounds),) * count
        self._ranges = np.array([leg.command_range for leg in legs])
        self.plant = Plant(self.legs, options.disturbance, options.soft_limits, noise)
        self.believed = tuple(leg.believed for leg in legs)
        """What is told of each leg."""
        self.full_torque = np.array([options.action_torque] * count, np.float64)
        """Joint torques of full actions, N m, (n, 2)."""
        if options.observation == AnyLeg.name:
            self.full_torque = np.array(list(map(robot_numbers.full_torque, self.believed)))
        self.observation = make_observation(robot, options, count, self.believed)
        self._initial_states = InitialStates(
            robot, options.reset_distribution, self.believed, self.legs.geometry
        )

    def _randomize(self, seed: int) -> None:
        """Let every leg go on with numbers of its own, the same ones for the same seed."""
        self._legs_seed, ranges = seed, self.options.randomised
        if ranges:
            rng = np.random.default_rng(seed)
            variants = randomization.sample(self.robot, ranges, self.count, rng)
            self.legs.set_robots(variants)
            self._numbers = randomization.normalized(self.robot, variants, ranges)

    @property
    def mean_apex_error(self) -> float:
        """Mean |apex - command| over the latest hops of all legs, m; NaN before the first."""
        errors = self._recent_errors
        return sum(map(abs, errors)) / len(errors) if errors else math.nan

    @property
    def privileged_size(self) -> int:
        """Entries of the true state that a critic may see."""
        return _PRIVILEGED + len(self.options.randomised)

    def reseed(self, rng: np.random.Generator, command: Array | None = None) -> Array32:
        """Take all randomness from another source and begin anew, see ``reset``."""
        noise, self._rng, legs = rng.spawn(3)
        self.plant.reseed(noise)
        self._randomize(int(legs.integers(2**62)))
        return self.reset(None, command)

    def reset(self, ids: IntArray | None = None, command: Array | None = None) -> Array32:
        """Begin new episodes of some legs, or of all, staggered; return all observations.

        A given ``command``, m, (k,), holds until its leg's episode ends; None draws one.
        """
        rows = np.arange(self.count) if ids is None else np.asarray(ids)
        self._begin(rows, command)
        if ids is None and self.options.random_episode_start:
            grid = self.options.episode_grid
            periods = self._rng.integers(1, self.episode_steps // grid + 1, self.count)
            self._end[:] = self._tick + periods * grid
            self._plan()
        return self._see_anew(rows)

    def step(self, action: Array | Array32) -> Step:
        """Act for a period; actions are torques over ``action_torque`` in [-1, 1], (n, 2).

        UsageError refuses what is not finite or of another shape; nothing has moved.
        """
        legs = self.legs
        taken, torque = np.array(action, np.float64), self._torque
        if taken.shape != torque.shape or not _clip(taken, self.full_torque, torque):
            raise errors.UsageError(
                "Actions are torques of hip and knee over the full action's, finite numbers from"
                f" -1 to 1 in the shape ({self.count}, 2), not {taken.tolist()!r:.60} in"
                f" {taken.shape}."
            )
        command, height_before = self.command.copy(), legs.height.copy()
        self.applied_torque = self.plant.drive(torque)
        self._columns[:] = legs.state.T
        transition = rewards.Transition(
            *self._true, command, taken, self.last_action, self.applied_torque, self._never,
            self._nan, legs.foot_clearance,
        )  # fmt: skip
        apex_error = self._find_apexes(transition, height_before)
        reward, terms = self.reward(transition)
        self.last_action = taken
        return self._next(reward, terms, command, apex_error, transition.apex_height)

    def __reduce__(self) -> NoReturn:
        """Refuse copies, whose arrays would no longer share what they must."""
        raise errors.UsageError(
            "An environment cannot be copied or pickled; make another with the same arguments and"
            " let it go on with its task.restore(...) from this one's task.state()."
        )

    def _find_apexes(self, transition: rewards.Transition, height_before: Array) -> Array:
        """Set the transition's apexes; return their errors."""
        rose, self._rises = self._rises, np.empty(self.count, np.bool_)
        self._since_apex += 1 / self.options.rate
        if not _update_rises(self.legs.state, rose, self._rises):
            return self._nan
        apex = hop_detection.at_apex(rose, self._rises, transition.foot_clearance)
        height = np.where(apex, np.maximum(height_before, transition.height), np.nan)
        transition.apex, transition.apex_height = apex, height
        self._since_apex[apex] = 0.0
        error: Array = height - transition.command
        self._recent_errors = [*self._recent_errors, *error[apex].tolist()][-_RECENT:]
        return error

    def privileged(self) -> Array32:
        """Return normalised true states, (n, size).

        Base height and rate, q (2), qd (2), command, clearance of foot, knee and base; how far the
        base would rise above the command without the ground, how near that is to it, and whether it
        rises; last action (2), time since the last apex, and where the legs' numbers lie in their
        ranges. The base's height is scaled like the command.
        """
        legs, (offset, gain) = self.legs, self._scaling
        excess = ballistic_apex(legs.height, legs.height_rate) - self.command
        out = np.empty((self.count, self.privileged_size), np.float32)
        out[:, 0] = (legs.height - offset[4]) * gain[4]
        out[:, 1] = legs.height_rate
        out[:, 2:4] = (legs.q - offset[:2]) * gain[:2]
        out[:, 4:6] = legs.qd * gain[2:4]
        out[:, 6] = (self.command - offset[4]) * gain[4]
        gaps = legs.foot_clearance(), legs.knee_clearance(), legs.base_clearance()
        out[:, 7:10] = np.stack(gaps, axis=1) * _CLEARANCE_GAIN
        out[:, 10] = np.clip(excess / _EXCESS, -3, 3)
        out[:, 11] = np.exp(-np.abs(excess) / _NEAR)
        out[:, 12] = np.sign(legs.height_rate)
        out[:, 13:15], out[:, 15] = self.last_action, self._since_apex
        out[:, _PRIVILEGED:] = self._numbers
        return out

    def state(self) -> dict[str, Any]:
        """Return everything needed to go on exactly from here, as arrays and plain values."""
        return {**super().state(), "legs": self.legs.memory()}

    def restore(self, state: dict[str, Any]) -> Array32:
        """Go on from a ``state``; return the observations, (n, size)."""
        if state["_legs_seed"] != self._legs_seed:
            self._randomize(state["_legs_seed"])
        super().restore(state)
        self.legs.restore(state["legs"])
        self._plan()
        self._samples = self.plant.samples(self.command)
        return self.observation.view(self._samples)

    @property
    def measurement(self) -> Measurement:
        """What the observation was made of: samples and their age."""
        return self.plant.channel.measurement(self._samples)

    def _see_anew(self, rows: IntArray) -> Array32:
        self._samples = self.plant.samples(self.command)
        self.observation.restart(rows, self._samples, self.plant.channel)
        return self.observation.view(self._samples)

    def _next(
        self, reward: Array, terms: Array, command: Array, apex_error: Array, apex_height: Array
    ) -> Step:
        self._tick += 1
        if self._tick >= self._next_switch:
            due = np.flatnonzero(self._switch <= self._tick)
            self.command[due] = self._draw_commands(due)
            self._switch[due] = self._tick + self._draw_holds(len(due))
            self._plan()
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
        self.observation.advance(self._samples, self.plant.channel, self.last_action)
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
            final_observation, final_privileged, command,
        )  # fmt: skip

    def _begin(self, rows: IntArray, command: Array | None = None) -> None:
        count = len(rows)
        self.command[rows] = self._draw_commands(rows) if command is None else command
        height, q = self._initial_states.draw(rows, self.command[rows], self._rng)
        self.legs.place(rows, height, q)
        self._end[rows] = self._tick + self.episode_steps
        self.last_action[rows], self._rises[rows], self._since_apex[rows] = 0.0, False, 0.0
        self.reward.restart(rows)
        self._switch[rows] = np.iinfo(np.int64).max
        if self.options.command_resampling_time is not None and command is None:
            self._switch[rows] = self._tick + self._draw_holds(count)
        self.plant.channel.restart(rows, self.legs.q[rows], self.legs.qd[rows], self.command[rows])
        self._plan()

    def _plan(self) -> None:
        """Note the next tick at which an episode ends or a command changes."""
        self._next_end, self._next_switch = int(self._end.min()), int(self._switch.min())

    def _draw_commands(self, rows: IntArray) -> Array:
        if self.task_legs or self.options.command_range is not None:
            low, high = self._ranges[rows].T
            return self._rng.uniform(low, high, len(rows))
        return self._rng.choice(self.options.commands, len(rows))

    def _draw_holds(self, count: int) -> IntArray:
        """Return after how many ticks commands change, (count,)."""
        assert self.options.command_resampling_time is not None
        shortest, longest = (
            max(1, round(time * self.options.rate)) for time in self.options.command_resampling_time
        )
        return self._rng.integers(shortest, longest + 1, count)


@compiled
def _clip(action: Array, full: Array, torque: Array) -> bool:
    """Clip actions to [-1, 1], set torques by ``full`` ones, (n, 2); tell if all are finite."""
    for leg in range(len(action)):
        for joint in range(2):
            if not math.isfinite(action[leg, joint]):
                return False
            if abs(action[leg, joint]) > 1:
                action[leg, joint] = math.copysign(1.0, action[leg, joint])
            torque[leg, joint] = action[leg, joint] * full[leg, joint]
    return True


@compiled
def _update_rises(state: Array, rose: BoolArray, rises: BoolArray) -> int:
    """Set which bases rise, (n,); return how many have stopped to rise since."""
    stopped = 0
    for leg in range(len(rose)):
        rises[leg] = state[leg, 3] > 0
        stopped += rose[leg] > rises[leg]
    return stopped
