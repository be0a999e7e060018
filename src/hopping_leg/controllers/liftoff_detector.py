"""Lift-off from the joints alone, under any hopping controller.

Whoever hops presses the leg apart, fast and with force, and then stops: the leg is in the air.
"""

import numpy as np

from hopping_leg.arrays import Array, BoolArray
from hopping_leg.controllers.leg_view import LegView
from hopping_leg.robot.model import GRAVITY
from hopping_leg.robot.parameters import Robot

_SMOOTHING = 0.25
"""Share of the newest force in the pressing force."""

_LEAST_PRESS = 1 / 3
"""Pressing force that begins a push, weights."""

_BEGIN, _END, _LEAST = 0.2, 0.06, 0.3
"""Leg rate that begins a push, ends it, and must have been reached, sqrt(gravity x height)."""

_SUDDEN = 0.15
"""Time between the fastest leg rate and the end of a push, s; who only rises slows down for longer.
"""

_BLIND = 0.9
"""Share of the ballistic flight in which no push is believed."""


class LiftoffDetector:
    """Tells when n legs leave the ground.

    Args:
        robot: The leg.
        period: Control period, s.
        count: Number of legs n.
    """

    def __init__(self, robot: Robot, period: float, count: int) -> None:
        self._period, self._weight = period, robot.mass * GRAVITY
        self._speed = float(np.sqrt(GRAVITY * robot.straight_height))
        self._press, self._fastest = np.zeros(count), np.zeros(count)
        self._pushing = np.zeros(count, np.bool_)
        self._blind, self._slowing = np.zeros(count), np.zeros(count)

    def update(self, leg: LegView, force: Array) -> BoolArray:
        """Return which legs have just left the ground, (n,).

        Args:
            leg: State of the legs.
            force: Along the leg, that the joints' torques press with, N, (n,).
        """
        bounded = np.clip(force, -4 * self._weight, 8 * self._weight)
        self._press += _SMOOTHING * (bounded - self._press)
        self._blind = np.maximum(self._blind - self._period, 0.0)
        begins = (self._press > _LEAST_PRESS * self._weight) & (leg.rate > _BEGIN * self._speed)
        begins &= ~self._pushing & (self._blind == 0)
        self._fastest = np.where(begins, 0.0, self._fastest)
        self._pushing |= begins
        faster = leg.rate > self._fastest
        self._slowing = np.where(faster, 0.0, self._slowing + self._period)
        self._fastest = np.where(faster, leg.rate, self._fastest)
        over = self._pushing & ((leg.rate < _END * self._speed) | (self._press < 0))
        self._pushing &= ~over
        left: BoolArray = over & (self._fastest > _LEAST * self._speed)
        left &= self._slowing < _SUDDEN
        self._blind = np.where(left, _BLIND * 2 * self._fastest / GRAVITY, self._blind)
        return left
