"""What a learner sees: a policy layout's inputs, normalised and joined.

``three-samples`` is the paper's 15-dimensional observation (Sec. II-C, "Observation and action
space"): three samples, newest first, each of normalised (q1, q2, qd1, qd2, command). Joint
positions run from -1 at the lower to 1 at the upper soft limit, velocities are divided by one
scale, the command runs from -1 to 1 over its range.
"""

import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from hopping_leg.arrays import Array, Array32, IntArray, Stateful
from hopping_leg.controllers import observation_history
from hopping_leg.envs.task_config import TaskConfig
from hopping_leg.robot.parameters import Robot
from hopping_leg.sim import SAMPLES, Channel
from hopping_leg.sim.compiled import compiled

SIZE = 15  # Entries of the paper's observation

_LEAST_SPAN = 0.05  # half the command range at least, m, so that a single command has a scale
_VELOCITY = 10.0  # joint velocity that is shown as 1, rad/s
_LATE = 0.025  # age of a sample that is shown as 1, s


class Scaling(NamedTuple):
    """Normalised value = (value - offset) * gain."""

    offset: Array
    """In SI units, (k,)."""
    gain: Array
    """Inverse scales of the same, (k,)."""


class Observation(Stateful):
    """The observations of n legs: the paper's, straight from the channel's samples.

    Attributes:
        size: Entries of an observation.
        scaling: Scaling of the joined inputs of the layout that gives a policy the same.
        order: Where each of these stands in an observation, (size,).
        command_direction: What a command that is lower by a leg's length adds to an observation,
            (size,).
    """

    def __init__(self, sample: Scaling) -> None:
        place = np.arange(SIZE).reshape(SAMPLES, 5)
        order = np.concatenate([place[:, 0:2].ravel(), place[:, 2:4].ravel(), place[:, 4]])
        self._describe(Scaling(*(np.tile(values, SAMPLES)[order] for values in sample)), order)
        self._sample = sample

    def _describe(self, scaling: Scaling, order: IntArray) -> None:
        self.scaling, self.order, self.size = scaling, order, len(order)
        self.command_direction = np.zeros(self.size)

    def view(self, samples: Array) -> Array32:
        """Return what is seen in this tick, (n, size)."""
        seen = np.empty((len(samples), SIZE), np.float32)
        _normalise(samples, self._sample.offset, self._sample.gain, seen)
        return seen

    def advance(self, samples: Array, channel: Channel, last_action: Array) -> None:
        """Update with a tick's samples (q1, q2, qd1, qd2, command), newest first, (n, 3, 5).

        The last action is that of a tick ago, zero at the start of an episode, (n, 2).
        """

    def restart(self, rows: IntArray, samples: Array, channel: Channel) -> None:
        """Forget the past of some legs, which begin anew within this tick."""


@compiled
def _normalise(samples: Array, offset: Array, gain: Array, seen: Array32) -> None:
    for leg in range(len(samples)):
        for k in range(samples.shape[1]):
            for i in range(5):
                seen[leg, 5 * k + i] = (samples[leg, k, i] - offset[i]) * gain[i]


class HistoryObservation(Observation):
    """The inputs of any policy layout, made by the very code that makes them on the robot."""

    STATE = ("_history",)

    def __init__(
        self,
        history: observation_history.ObservationHistory,
        scaling: Scaling,
        torque: Array,
        count: int,
    ) -> None:
        self._describe(scaling, np.arange(len(scaling.offset)))
        self._history, self._torque = history, torque
        sizes = [math.prod(history.shapes[name]) for name in history.network_inputs]
        ends = itertools.pairwise(itertools.accumulate(sizes, initial=0))
        self._joined = np.empty((count, self.size))
        self._parts = [
            (name, self._joined[:, first:last].reshape(count, *history.shapes[name]))
            for name, (first, last) in zip(history.network_inputs, ends, strict=True)
        ]
        history.reset(count)

    def advance(self, samples: Array, channel: Channel, last_action: Array) -> None:
        """Update the history with a new tick."""
        self._history.update(channel.measurement(samples), last_action * self._torque)

    def restart(self, rows: IntArray, samples: Array, channel: Channel) -> None:
        """Let the history forget the past of some legs."""
        self._history.restart(rows, channel.measurement(samples))

    def view(self, samples: Array) -> Array32:
        """Return the normalised inputs, (n, size)."""
        inputs = self._history.inputs()
        for name, part in self._parts:
            part[:] = inputs[name]
        seen = np.empty(self._joined.shape, np.float32)
        np.subtract(self._joined, self.scaling.offset, out=self._joined)
        return np.multiply(self._joined, self.scaling.gain, out=seen)


def sample_scaling(robot: Robot, config: TaskConfig) -> Scaling:
    """Return the normalisation of (q1, q2, qd1, qd2, command), rad, rad/s, m, (5,)."""
    lower, upper = robot.of_joints("lower"), robot.of_joints("upper")
    low, high = config.command_bounds
    half = max((high - low) / 2, _LEAST_SPAN)
    offset = np.concatenate([(lower + upper) / 2, [0.0, 0.0, (low + high) / 2]])
    span = np.concatenate([(upper - lower) / 2, [_VELOCITY, _VELOCITY, half]])
    return Scaling(offset, 1 / span)


def make_observation(
    robot: Robot, config: TaskConfig, count: int, believed: Sequence[Robot] = ()
) -> Observation:
    """Return the observation that a task asks for, of legs of which something else is believed."""
    sample = sample_scaling(robot, config)
    if config.observation == observation_history.ThreeSamples.name:
        return Observation(sample)
    history = observation_history.make_observation_history(config.observation, 1 / config.rate)
    history.set_robots(believed or [robot])
    sizes = {name: math.prod(history.shapes[name]) for name in history.network_inputs}
    if isinstance(history, observation_history.AnyLeg):  # it scales its inputs itself
        size = sum(sizes.values())
        unit = Scaling(np.zeros(size), np.ones(size))
        seen = HistoryObservation(history, unit, history.full_torque, count)
        names = np.repeat(list(sizes), list(sizes.values()))
        seen.command_direction[names == "command"] = -history.COMMAND_GAIN
        return seen
    torque = np.array(config.action_torque)
    units = {
        "q": (sample.offset[0:2], sample.gain[0:2]),
        "qd": (sample.offset[2:4], sample.gain[2:4]),
        "age": (np.zeros(1), np.full(1, 1 / _LATE)),
        "past_torque": (np.zeros(2), 1 / torque),
        "command": (sample.offset[4:5], sample.gain[4:5]),
    }
    columns = [
        [np.tile(values, size // len(values)) for values in units[name]]
        for name, size in sizes.items()
    ]
    scaling = Scaling(*(np.concatenate(column) for column in zip(*columns, strict=True)))
    return HistoryObservation(history, scaling, torque, count)
