"""What no policy can see of a leg, as numbers about -1 to 1: a student is asked to guess them."""

import math
from collections.abc import Sequence

import numpy as np

from hopping_leg.arrays import Array, Array32, BoolArray, Stateful
from hopping_leg.controllers import robot_numbers
from hopping_leg.robot import GRAVITY, Robot
from hopping_leg.sim import LegSimulator

OF_MOTION = 4  # Height, its rate, contact, and how far the last hop missed its command
MISSED = 3  # Place of the last of these
ERROR_GAIN = 16.0  # Of errors of hops, over the leg's length

_MOST_ERROR = 0.3


class HiddenState(Stateful):
    """Height and contact, the last hop's error, and how the legs differ from what is told of them.

    ``size`` is how many numbers these are.
    """

    STATE = ("error", "_flying")

    def __init__(self, legs: LegSimulator, believed: Sequence[Robot]) -> None:
        pairs = zip(believed, legs.robots, strict=True)
        self._constant = np.array([_difference(told, true) for told, true in pairs])
        self._length = np.array([robot_numbers.leg_length(robot) for robot in believed])
        self._foot = np.array([robot.foot.radius for robot in believed])
        self._speed = np.sqrt(GRAVITY * self._length)
        self._legs = legs
        self._flying = np.full(legs.count, np.nan)
        self.error = np.zeros(legs.count)
        """Apex less the command of the last hop that has landed, m, (n,): what can be known."""
        self.size = OF_MOTION + self._constant.shape[1]

    def update(self, apex_error: Array, begun: BoolArray) -> None:
        """Remember the errors of apexes, m, NaN for none, and forget those of new episodes."""
        known = ~np.isnan(apex_error)
        self._flying[known] = apex_error[known]
        landed = ~np.isnan(self._flying) & (self._legs.foot_clearance() <= 0)
        self.error[landed], self._flying[landed] = self._flying[landed], np.nan
        self.error[begun], self._flying[begun] = 0.0, np.nan

    def view(self) -> Array32:
        """Return the numbers now, (n, size)."""
        legs = self._legs
        error = (self.error / self._length).clip(-_MOST_ERROR, _MOST_ERROR)
        motion = (
            3 * ((legs.height - self._foot) / self._length - 0.8),
            1.5 * legs.height_rate / self._speed,
            legs.foot_clearance() <= 0,
            ERROR_GAIN * error,
        )
        return np.concatenate([np.stack(motion, axis=1), self._constant], axis=1, dtype=np.float32)


def _difference(told: Robot, true: Robot) -> Array:
    """Return masses and gains over those told, and what delays, rubs and gives way."""
    moment = true.mass * GRAVITY * robot_numbers.leg_length(true)
    stiffness = true.reality.knee.stiffness
    return np.array(
        [
            4 * math.log(true.mass / told.mass),
            4 * math.log(true.hip.torque_gain),
            4 * math.log(true.knee.torque_gain),
            math.log(true.contact.time_constant / 0.03),
            10 * true.rail.friction / (true.mass * GRAVITY),
            true.reality.latency.command / 0.005,
            2 * math.log1p(5 * true.hip.friction / moment),
            2 * math.log1p(5 * true.knee.friction / moment),
            10 * moment / stiffness if stiffness else 0.0,
        ]
    )
