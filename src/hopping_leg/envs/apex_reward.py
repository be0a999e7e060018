"""A reward that asks for what is judged: the height of every apex.

At an apex, its height is compared with the command; in flight, the one that ballistics predicts is
at every tick, more weakly. Both are weighted with the motion behind them, because a leg that stands
at the commanded height and trembles has perfect apexes too. The event is also weighted with the
time since the last one: otherwise many hasty hops pay more than few precise ones, and the leg
bounces off the ground without the time to correct itself. An energy gain like the paper's Ge starts
the motion and fades out; kernels narrow while training proceeds. The paper's penalties stay, and
one keeps body and knee off the ground.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hopping_leg.arrays import Array, IntArray
from hopping_leg.controllers import robot_numbers
from hopping_leg.envs.paper_reward import jerk_term
from hopping_leg.envs.rewards import LastingTerm, Reward, RewardTerm, Transition, sum_of_joints
from hopping_leg.robot import Robot, kinematics

GRAVITY = 10.4  # Deceleration in flight that predictions assume, rail drag included, m/s2
TOUCH = 3.0
"""What a tick adds to the closeness to the ground in which base or knee are within 6 mm of it."""

_FASTEST_SQUARED = 4.0  # base velocity squared beyond which the energy gain grows no more, m2/s2
_PREDICTION_WIDTHS = (0.015, 0.06)  # widths of the two kernels around the predicted apex, m
_FULL_AIR, _FULL_PERIOD = 0.1, 0.45  # time in the air and since the last apex for full weight, s
_SHARP_FROM, _FULL_PRICE, _ENERGY_UNTIL = 0.7, 0.5, 0.35
"""Shares of the training: least width, highest prices, no more energy gain."""
_LIMIT_MARGIN, _REVERSAL = 0.05, 0.2  # rad within joint limits; change of an action
_SPEED = 20.0  # joint speed that costs nothing, rad/s
_BASE_MARGIN, _KNEE_MARGIN, _TOUCH_MARGIN = 0.04, 0.02, 0.006  # gaps to the ground, m


@dataclass(frozen=True)
class ApexRewardConfig:
    """Weights and widths; rewards are scaled down at the end for the critic's sake."""

    scale: float = 0.05
    """Factor of the weighted sum."""
    apex: float = 60.0
    """Weight of the event: an apex near the command."""
    width: tuple[float, float] = (0.030, 0.010)
    """Width of its kernel exp(-|error| / width) at the start and late in the training, m."""
    predicted: float = 0.3
    """Weight of the prediction in flight."""
    energy: float = 0.4
    """Weight of the base's velocity squared, fading to zero."""
    energy_beyond: float = 0.0
    """How far above the command the predicted apex is where the most of that gain has fallen to
    1/e, m; 0 pays it at any height. A leg that is paid for hopping too high for long learns a gait
    for it, stretched at every command, from which the narrow kernels do not lead back."""
    jerk: float = 0.15
    """Weight of the paper's Pj."""
    effort: float = 0.0
    """Weight of the actions' squares in flight, where they move nothing but the leg itself."""
    power: float = 0.0
    """Weight of the motors' |torque x speed| over weight x sqrt(g L), rising like ``reversals``."""
    reversals: float = 0.0
    """Weight of changes of an action's sign by more than 0.2; it rises from none until half of the
    training."""
    limits: tuple[float, float] = (1.0, 1.0)
    """Weight of how far joints are outside of 0.05 rad within their limits, rad, at the start and
    from half of the training on."""
    velocity: float = 0.005
    """Weight of joint speed beyond what a hop needs."""
    clearance: float = 1.0
    """Weight of base and knee coming close to the ground."""


def apex_reward(robot: Robot, config: ApexRewardConfig, rate: float) -> Reward:
    """Return the reward that judges ticks by predicted and reached apexes; rate is in Hz."""
    c = config
    lower = robot.of_joints("lower")[None] + _LIMIT_MARGIN
    upper = robot.of_joints("upper")[None] - _LIMIT_MARGIN

    def bounded_energy_gain(t: Transition) -> Array:
        most: float | Array = _FASTEST_SQUARED
        if c.energy_beyond > 0:
            beyond = np.maximum(ballistic_apex(t.height, t.rate) - t.command, 0.0)
            most = most * np.exp(-beyond / c.energy_beyond)
        return np.minimum(np.square(t.rate), most)

    def price(first: float, last: float) -> Callable[[float], float]:
        return lambda share: -(first + (last - first) * min(1.0, share / _FULL_PRICE))

    unit = robot.mass * robot_numbers.leg_length(robot) ** 2 / robot_numbers.fall_time(robot) ** 3

    def power(t: Transition) -> Array:
        return sum_of_joints(np.abs(t.torque * t.qd)) / unit

    def reversals(t: Transition) -> Array:
        turned = t.action * t.last_action < 0
        far = np.abs(t.action - t.last_action) > _REVERSAL
        return sum_of_joints((turned & far).astype(np.float64))

    def speeding(t: Transition) -> Array:
        return sum_of_joints(np.maximum(np.abs(t.qd) - _SPEED, 0.0))

    def excess(t: Transition) -> Array:
        return sum_of_joints(np.maximum(lower - t.q, 0.0) + np.maximum(t.q - upper, 0.0))

    def ground_closeness(t: Transition) -> Array:
        base = kinematics.base_clearance(robot, t.height)
        knee = kinematics.knee_clearance(robot, t.height, t.q)
        inside = np.maximum(1 - base / _BASE_MARGIN, 0.0) + np.maximum(1 - knee / _KNEE_MARGIN, 0.0)
        closeness: Array = inside + TOUCH * (np.minimum(base, knee) < _TOUCH_MARGIN)
        return closeness

    return Reward(
        (
            RewardTerm("apex", c.apex, ApexEvent(c.width, 1 / rate)),
            RewardTerm("predicted", c.predicted, predicted_apex_accuracy),
            RewardTerm(
                "energy",
                lambda share: c.energy * max(0.0, 1 - share / _ENERGY_UNTIL),
                bounded_energy_gain,
            ),
            jerk_term(c.jerk),
            RewardTerm("effort", -c.effort, lambda t: sum_of_joints(t.action**2) * t.flying),
            RewardTerm("power", price(0.0, c.power), power),
            RewardTerm("reversals", price(0.0, c.reversals), reversals),
            RewardTerm("limits", price(*c.limits), excess),
            RewardTerm("velocity", -c.velocity, speeding),
            RewardTerm("clearance", -c.clearance, ground_closeness),
        ),
        c.scale,
    )


class ApexEvent(LastingTerm):
    """How near an apex is to the command, by the motion and the time before it.

    An episode begins as if its last apex were long ago, so that the first one pays like any.
    Widths are in m, the control period is in s.
    """

    STATE = ("_air", "_since")

    def __init__(self, width: tuple[float, float], period: float) -> None:
        self._widths, self._period = width, period
        self._air = self._since = np.zeros(0)
        self.anneal(0.0)

    def anneal(self, share: float) -> None:
        """Narrow the kernel at a share of the training, 0 to 1."""
        wide, narrow = self._widths
        self._width = wide + (narrow - wide) * min(1.0, share / _SHARP_FROM)

    def __call__(self, t: Transition) -> Array:
        """Return the kernel of the apex error, weighted, 0 without an apex, (n,)."""
        event = np.zeros(len(t.apex))
        if len(self._air) != len(event):
            self._air, self._since = event.copy(), event + _FULL_PERIOD
        self._air = (self._air + self._period) * t.flying
        self._since = self._since + self._period
        (legs,) = t.apex.nonzero()
        if len(legs):
            motion = np.square(np.minimum(1.0, self._air[legs] / _FULL_AIR))
            patience = np.minimum(1.0, self._since[legs] / _FULL_PERIOD)
            error = np.abs(t.apex_height[legs] - t.command[legs])
            event[legs] = motion * patience * np.exp(-error / self._width)
            self._since[legs] = 0.0
        return event

    def restart(self, rows: IntArray) -> None:
        """Forget the past of some legs."""
        if len(self._air):
            self._air[rows], self._since[rows] = 0.0, _FULL_PERIOD


def ballistic_apex(height: Array, rate: Array) -> Array:
    """Return the height that a base reaches without the ground, m, from its height and velocity."""
    return height + np.square(rate) / (2 * GRAVITY)


def predicted_apex_accuracy(t: Transition) -> Array:
    """Return base speed times how near the ballistic apex is to the command, 0 on the ground."""
    error = np.abs(ballistic_apex(t.height, t.rate) - t.command)
    narrow, wide = _PREDICTION_WIDTHS
    kernel = np.exp(error / -narrow) + 0.5 * np.exp(error / -wide)
    return np.abs(t.rate) * kernel * t.flying
