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
from typing import Any

import numpy as np

from hopping_leg.arrays import Array, IntArray
from hopping_leg.envs.paper_reward import action_jerk, joint_position_penalty, position_limits
from hopping_leg.envs.rewards import PerLeg, Reward, RewardTerm, Transition, sum_of_joints
from hopping_leg.robot import Robot, kinematics

_FASTEST_SQUARED = 4.0  # base velocity squared beyond which the energy gain grows no more, m2/s2
_PREDICTION_WIDTHS = (0.015, 0.06)  # widths of the two kernels around the predicted apex, m


@dataclass(frozen=True)
class ApexRewardConfig:
    """Weights and widths; rewards are scaled down at the end for the critic's sake."""

    scale: float = 0.05
    """Factor of the weighted sum."""
    apex: float = 60.0
    """Weight of the event: kernel(|apex - command|) (air / full_air)^2 (period / full_period)."""
    width: tuple[float, float] = (0.030, 0.010)
    """Width of its kernel exp(-|error| / width) at the start and from ``sharp_from`` on, m."""
    tail: float = 0.0
    """Share of the event's kernel that stays as wide as at the start, to lead back from afar."""
    sharp_from: float = 0.7
    """Share of the training after which the kernel narrows no more."""
    full_air: float = 0.1
    """Time in the air before the apex that earns the event's full weight, s."""
    full_period: float = 0.45
    """Time since the last apex that earns the event's full weight, s."""
    predicted: float = 0.3
    """Weight of the prediction in flight: |v| (e^(-e/15 mm) + e^(-e/60 mm) / 2)."""
    effective_gravity: float = 10.4
    """Deceleration in flight that the prediction assumes, rail drag included, m/s2."""
    energy: float = 0.4
    """Weight of v^2 anywhere, fading to zero until ``energy_until``."""
    energy_until: float = 0.35
    """Share of the training after which that gain is gone."""
    energy_beyond: float = 0.0
    """How far above the command the predicted apex is where the most of that gain has fallen to
    1/e, m; 0 pays it at any height. A leg that is paid for hopping too high for long learns a gait
    for it, stretched at every command, from which the narrow kernels do not lead back."""
    jerk: float = 0.15
    """Weight of the paper's Pj."""
    effort: float = 0.0
    """Weight of the actions' squares in flight, where they move nothing but the leg itself."""
    position: float = 0.02
    """Weight of the paper's Pjp."""
    velocity: float = 0.005
    """Weight of joint speed beyond ``velocity_limit``."""
    velocity_limit: float = 20.0
    """Joint speed that costs nothing, rad/s."""
    clearance: float = 1.0
    """Weight of coming closer to the ground than the two margins below, relative to them."""
    base_margin: float = 0.04
    """Wanted gap between base and ground, m."""
    knee_margin: float = 0.02
    """Wanted gap between knee and ground, m."""
    touch: float = 3.0
    """What a tick adds to that term in which base or knee touch the ground, or nearly so."""
    touch_margin: float = 0.006
    """Gap that counts as touching, m."""


def apex_reward(robot: Robot, config: ApexRewardConfig, rate: float) -> Reward:
    """Return the reward that judges ticks by predicted and reached apexes; rate is in Hz."""
    c = config
    return Reward(
        (
            RewardTerm("apex", c.apex, ApexEvent(config, rate)),
            RewardTerm("predicted", c.predicted, predicted_apex_accuracy(c.effective_gravity)),
            RewardTerm(
                "energy",
                lambda share: c.energy * max(0.0, 1 - share / c.energy_until),
                bounded_energy_gain(c.energy_beyond, c.effective_gravity),
            ),
            RewardTerm("jerk", -c.jerk, PerLeg(action_jerk)),
            RewardTerm("effort", -c.effort, flight_effort),
            RewardTerm(
                "position", -c.position, PerLeg(joint_position_penalty, position_limits(robot))
            ),
            RewardTerm("velocity", -c.velocity, joint_overspeed(c.velocity_limit)),
            RewardTerm("clearance", -c.clearance, ground_closeness(robot, config)),
        ),
        c.scale,
    )


class ApexEvent:
    """How near an apex is to the command, by the motion and the time before it.

    An episode begins as if its last apex were long ago, so that the first one pays like any.
    """

    def __init__(self, config: ApexRewardConfig, rate: float) -> None:
        self._config, self._rate = config, rate
        self._air = self._since = np.zeros(0)
        self.anneal(0.0)

    def anneal(self, share: float) -> None:
        """Narrow the kernel at a share of the training, 0 to 1."""
        wide, narrow = self._config.width
        self._width = wide + (narrow - wide) * min(1.0, share / self._config.sharp_from)

    def __call__(self, t: Transition) -> Array:
        """Return the kernel of the apex error, weighted, 0 without an apex, (n,)."""
        c, flying = self._config, t.flying
        if len(self._air) != len(flying):
            self._air, self._since = np.zeros(len(flying)), np.full(len(flying), c.full_period)
        self._air = np.where(flying, self._air + 1 / self._rate, 0.0)
        self._since = self._since + 1 / self._rate
        motion = np.square(np.minimum(1.0, self._air / c.full_air))
        patience = np.minimum(1.0, self._since / c.full_period)
        self._since = np.where(t.apex, 0.0, self._since)
        error = np.abs(t.apex_height - t.command)
        kernel = (1 - c.tail) * np.exp(-error / self._width) + c.tail * np.exp(-error / c.width[0])
        return np.where(t.apex, motion * patience * kernel, 0.0)

    def restart(self, rows: IntArray) -> None:
        """Forget the past of some legs."""
        if len(self._air):
            self._air[rows], self._since[rows] = 0.0, self._config.full_period

    def state(self) -> dict[str, Any]:
        """Return every leg's time in the air and since its last apex."""
        return {"air": self._air.copy(), "since": self._since.copy()}

    def restore(self, state: dict[str, Any]) -> None:
        """Go on from a ``state``."""
        self._air, self._since = np.array(state["air"]), np.array(state["since"])


def predicted_apex_accuracy(effective_gravity: float) -> Callable[[Transition], Array]:
    """Return base speed times how near the ballistic apex is to the command, 0 on the ground."""

    def term(t: Transition) -> Array:
        apex = t.height + np.square(t.rate) / (2 * effective_gravity)
        error = np.abs(apex - t.command)
        narrow, wide = _PREDICTION_WIDTHS
        kernel = np.exp(-error / narrow) + 0.5 * np.exp(-error / wide)
        return np.where(t.flying, np.abs(t.rate) * kernel, 0.0)

    return term


def bounded_energy_gain(beyond: float, effective_gravity: float) -> Callable[[Transition], Array]:
    """Return base velocity squared, bounded, and less if the hop would be too high, m2/s2."""

    def term(t: Transition) -> Array:
        most: float | Array = _FASTEST_SQUARED
        if beyond > 0:
            apex = t.height + np.square(t.rate) / (2 * effective_gravity)
            most = most * np.exp(-np.maximum(apex - t.command, 0.0) / beyond)
        gain: Array = np.minimum(np.square(t.rate), most)
        return gain

    return term


def flight_effort(t: Transition) -> Array:
    """Return the sum of the actions' squares in flight, 0 on the ground."""
    return np.where(t.flying, sum_of_joints(np.square(t.action)), 0.0)


def joint_overspeed(limit: float) -> Callable[[Transition], Array]:
    """Return joint speed beyond a limit, summed over the joints, rad/s."""

    def term(t: Transition) -> Array:
        return sum_of_joints(np.maximum(np.abs(t.qd) - limit, 0.0))

    return term


def ground_closeness(robot: Robot, config: ApexRewardConfig) -> Callable[[Transition], Array]:
    """Return how far base and knee are inside their margins to the ground, more if they touch."""
    c = config

    def term(t: Transition) -> Array:
        base = kinematics.base_clearance(robot, t.height)
        knee = kinematics.knee_clearance(robot, t.height, t.q)
        base_inside = np.maximum(c.base_margin - base, 0.0) / c.base_margin
        knee_inside = np.maximum(c.knee_margin - knee, 0.0) / c.knee_margin
        touching = np.minimum(base, knee) < c.touch_margin
        return base_inside + knee_inside + c.touch * touching

    return term
