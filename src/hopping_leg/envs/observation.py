"""What a learner sees: a policy layout's inputs, normalised and joined.

``three-samples`` is the paper's 15-dimensional observation (Sec. II-C, "Observation and action
space"): three samples, newest first, each of normalised (q1, q2, qd1, qd2, command). Joint
positions run from -1 at the lower to 1 at the upper soft limit, velocities are divided by one
scale, the command runs from -1 to 1 over its range.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hopping_leg.arrays import Array, Array32, IntArray
from hopping_leg.controllers import observation_history
from hopping_leg.envs.task_config import TaskConfig
from hopping_leg.robot.parameters import Robot
from hopping_leg.sim import SAMPLES, Channel, Simulator
from hopping_leg.sim.compiled import compiled

SIZE = 15
"""Entries of the paper's observation."""


_LEAST_SPAN = 0.05
"""Half the command range of an observation at least, m, so that a single command has a scale."""

_LATE = 0.025  # age of a sample that an observation shows as 1, s


PRIVILEGED = 10
"""Entries of the true state, where all legs are the same."""

PRIVILEGED_HEIGHT, PRIVILEGED_COMMAND, PRIVILEGED_CLEARANCE = 0, 6, 7
"""Where the base's height, the command and the foot's clearance stand among them."""

CLEARANCE_GAIN = 10.0
"""Scale of clearances, 1/m."""


@dataclass(frozen=True)
class Scaling:
    """Normalised value = (value - offset) * gain."""

    offset: Array
    """In SI units, (k,)."""
    gain: Array
    """Inverse scales of the same, (k,)."""


class Observation(ABC):
    """Makes the observations of n legs."""

    layout: str
    """Name of the observation history that gives a trained policy the same inputs."""
    size: int
    """Entries of an observation."""
    order: IntArray
    """Where each of the history's joined inputs stands in an observation, (size,)."""
    scaling: Scaling
    """Scaling of the history's joined inputs."""

    @property
    def command_direction(self) -> Array:
        """What a command that is lower by a leg's length adds to an observation, (size,)."""
        return np.zeros(self.size)

    def advance(self, samples: Array, channel: Channel, last_action: Array) -> None:  # noqa: B027
        """Update with a tick's samples (q1, q2, qd1, qd2, command), newest first, (n, 3, 5).

        The last action is that of a tick ago, zero at the start of an episode, (n, 2).
        """

    def restart(self, rows: IntArray, samples: Array, channel: Channel) -> None:  # noqa: B027
        """Forget the past of some legs, which begin anew within this tick."""

    @abstractmethod
    def view(self, samples: Array) -> Array32:
        """Return what is seen in this tick, (n, size)."""

    def state(self) -> dict[str, Any]:
        """Return what is remembered from tick to tick."""
        return {}

    def restore(self, state: dict[str, Any]) -> None:  # noqa: B027
        """Go on from a ``state``."""


class PaperObservation(Observation):
    """The paper's three samples; made straight from the channel's, because it is the fast path."""

    layout = observation_history.ThreeSamples.name
    size = SIZE

    def __init__(self, sample: Scaling) -> None:
        place = np.arange(SIZE).reshape(SAMPLES, 5)
        self.order = np.concatenate([place[:, 0:2].ravel(), place[:, 2:4].ravel(), place[:, 4]])
        tiled = [np.tile(values, SAMPLES)[self.order] for values in (sample.offset, sample.gain)]
        self.scaling = Scaling(*tiled)
        self._sample = sample

    def view(self, samples: Array) -> Array32:
        """Return the normalised samples, (n, 15)."""
        seen = np.empty((len(samples), SIZE), np.float32)
        _normalise(samples, self._sample.offset, self._sample.gain, seen)
        return seen


@compiled
def _normalise(samples: Array, offset: Array, gain: Array, seen: Array32) -> None:
    for leg in range(len(samples)):
        for k in range(samples.shape[1]):
            for i in range(5):
                seen[leg, 5 * k + i] = (samples[leg, k, i] - offset[i]) * gain[i]


class HistoryObservation(Observation):
    """The inputs of any policy layout, made by the very code that makes them on the robot."""

    def __init__(
        self,
        layout: observation_history.ObservationHistory,
        scaling: Scaling,
        torque: Array,
        count: int,
    ) -> None:
        self._layout, self.layout = layout, layout.name
        self.scaling, self._torque = scaling, torque
        self.size = len(scaling.offset)
        self.order, self._count = np.arange(self.size), count
        layout.reset(count)

    @property
    def command_direction(self) -> Array:
        """What a command that is lower by a leg's length adds to an observation, (size,)."""
        layout = self._layout
        if not isinstance(layout, observation_history.AnyLeg):
            return super().command_direction
        names = layout.network_inputs
        parts = [
            np.full(math.prod(layout.shapes[n]), -layout.COMMAND_GAIN if n == "command" else 0.0)
            for n in names
        ]
        return np.concatenate(parts)

    def advance(self, samples: Array, channel: Channel, last_action: Array) -> None:
        """Update the layout with a new tick."""
        self._layout.update(channel.measurement(samples), last_action * self._torque)

    def restart(self, rows: IntArray, samples: Array, channel: Channel) -> None:
        """Let the layout forget the past of some legs."""
        self._layout.restart(rows, channel.measurement(samples))

    def view(self, samples: Array) -> Array32:
        """Return the normalised inputs, (n, size)."""
        inputs = self._layout.inputs()
        parts = [inputs[name].reshape(self._count, -1) for name in self._layout.network_inputs]
        joined = np.concatenate(parts, axis=1, dtype=np.float64)
        return ((joined - self.scaling.offset) * self.scaling.gain).astype(np.float32)

    def state(self) -> dict[str, Any]:
        """Return what the layout remembers."""
        return self._layout.state()

    def restore(self, state: dict[str, Any]) -> None:
        """Go on from a ``state``."""
        self._layout.restore(state)


def sample_scaling(robot: Robot, config: TaskConfig) -> Scaling:
    """Return the normalisation of (q1, q2, qd1, qd2, command), rad, rad/s, m, (5,)."""
    lower, upper = robot.of_joints("lower"), robot.of_joints("upper")
    low, high = config.command_bounds
    half = max((high - low) / 2, _LEAST_SPAN)
    offset = np.concatenate([(lower + upper) / 2, [0.0, 0.0, (low + high) / 2]])
    velocity = config.velocity_scale
    span = np.concatenate([(upper - lower) / 2, [velocity, velocity, half]])
    return Scaling(offset, 1 / span)


def make_observation(
    robot: Robot, config: TaskConfig, count: int, believed: Sequence[Robot] = ()
) -> Observation:
    """Return the observation that a task asks for, of legs of which something else is believed."""
    sample = sample_scaling(robot, config)
    if config.observation == observation_history.ThreeSamples.name:
        return PaperObservation(sample)
    layout = observation_history.make_observation_history(config.observation, 1 / config.rate)
    layout.set_robots(believed or [robot])
    if isinstance(layout, observation_history.AnyLeg):
        size = sum(math.prod(layout.shapes[name]) for name in layout.network_inputs)
        unit = Scaling(np.zeros(size), np.ones(size))
        return HistoryObservation(layout, unit, layout.full_torque, count)
    torque = np.array(config.action_torque)
    parts = {
        "q": (sample.offset[0:2], sample.gain[0:2]),
        "qd": (sample.offset[2:4], sample.gain[2:4]),
        "age": (np.zeros(1), np.full(1, 1 / _LATE)),
        "past_torque": (np.zeros(2), 1 / torque),
        "command": (sample.offset[4:5], sample.gain[4:5]),
    }
    columns = [
        [np.tile(values, shape[0] if len(shape) > 1 else 1) for values in parts[name]]
        for name, shape in layout.shapes.items()
    ]
    offset, gain = (np.concatenate(column) for column in zip(*columns, strict=True))
    return HistoryObservation(layout, Scaling(offset, gain), torque, count)


def privileged_observation(legs: Simulator, command: Array, sample: Scaling, out: Array32) -> None:
    """Write the normalised true state.

    Base height and rate, q (2), qd (2), command, clearance of foot, knee and base, to ``out``, (n,
    ``PRIVILEGED``); the base's height is scaled like the command.
    """
    offset, gain = sample.offset, sample.gain
    out[:, PRIVILEGED_HEIGHT] = (legs.height - offset[4]) * gain[4]
    out[:, 1] = legs.height_rate
    out[:, 2:4] = (legs.q - offset[:2]) * gain[:2]
    out[:, 4:6] = legs.qd * gain[2:4]
    out[:, PRIVILEGED_COMMAND] = (command - offset[4]) * gain[4]
    out[:, PRIVILEGED_CLEARANCE] = legs.foot_clearance() * CLEARANCE_GAIN
    out[:, 8] = legs.knee_clearance() * CLEARANCE_GAIN
    out[:, 9] = legs.base_clearance() * CLEARANCE_GAIN
