"""The paper's 15-dimensional observation (Sec. II-C, "Observation and action space").

Three samples, newest first, each of normalised (q1, q2, qd1, qd2, command). Joint positions run
from -1 at the lower to 1 at the upper soft limit, velocities are divided by one scale, the command
runs from -1 to 1 over its range.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hopping_leg.arrays import Array
from hopping_leg.env.options import TaskOptions
from hopping_leg.robot.parameters import Robot
from hopping_leg.sim import SAMPLES, Measurement

SIZE = 15
"""Entries of an observation."""

Array32 = npt.NDArray[np.float32]

_LEAST_SPAN = 0.05
"""Half the command range of an observation at least, m, so that a single command has a scale."""


@dataclass(frozen=True)
class Scaling:
    """Normalised sample = (sample - offset) * gain.

    Attributes:
        offset: Of (q1, q2, qd1, qd2, command), rad, rad/s, m, (5,).
        gain: Inverse scales of the same, (5,).
    """

    offset: Array
    gain: Array

    def repeated(self, count: int) -> "Scaling":
        """Return the same with arrays (count, 3, 5), which numpy combines faster."""
        shape = (count, SAMPLES, 1)
        return Scaling(np.tile(self.offset, shape), np.tile(self.gain, shape))

    def observe(self, measurement: Measurement) -> Array32:
        """Return what a policy sees of a measurement, (n, 15)."""
        samples = np.concatenate(
            [measurement.q, measurement.qd, measurement.command[..., None]], axis=-1
        )
        return self.normalise(samples)

    def normalise(self, samples: Array) -> Array32:
        """Return observations of samples (q1, q2, qd1, qd2, command), (n, 3, 5) to (n, 15)."""
        centred = samples - self.offset
        centred *= self.gain
        return centred.reshape(-1, SIZE).astype(np.float32)


def scaling(robot: Robot, options: TaskOptions) -> Scaling:
    """Return the normalisation for a robot and its task."""
    lower, upper = robot.of_joints("lower"), robot.of_joints("upper")
    low, high = options.command_bounds
    half = max((high - low) / 2, _LEAST_SPAN)
    offset = np.concatenate([(lower + upper) / 2, [0.0, 0.0, (low + high) / 2]])
    velocity = options.velocity_scale
    span = np.concatenate([(upper - lower) / 2, [velocity, velocity, half]])
    return Scaling(offset, 1 / span)
