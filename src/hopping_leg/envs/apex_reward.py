"""A reward that asks for what is judged: the height of every apex.

At an apex, its height is compared with the command; in flight, the one that ballistics predicts is
at every tick, more weakly. Both are weighted with the motion behind them, because a leg that stands
at the commanded height and trembles has perfect apexes too. The event is also weighted with the
time since the last one: otherwise many hasty hops pay more than few precise ones, and the leg
bounces off the ground without the time to correct itself. An energy gain like the paper's Ge starts
the motion and fades out; kernels narrow while training proceeds. The paper's penalties stay, and
one keeps body and knee off the ground.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from hopping_leg.arrays import Array, BoolArray
from hopping_leg.envs.transition import Transition
from hopping_leg.hop_detection import FLIGHT_CLEARANCE
from hopping_leg.robot import kinematics
from hopping_leg.robot.parameters import Robot

_SHARPNESS = 10.0
"""Of the joint limits' penalty, 1/rad, as in the paper's Pjp."""

_FASTEST_SQUARED = 4.0
"""Base velocity squared beyond which the energy gain grows no more, m2/s2."""


@dataclass(frozen=True)
class ApexRewardOptions:
    """Weights and widths; rewards are scaled down at the end for the critic's sake."""

    scale: float = 0.05
    """Of the whole."""
    apex: float = 60.0
    """Of the event: kernel(|apex - command|) (air / full_air)^2 (period / full_period)."""
    width: tuple[float, float] = (0.030, 0.010)
    """Of the event's kernel exp(-|error| / width) at the start and from ``sharp_from`` on, m."""
    tail: float = 0.0
    """Share of the event's kernel that stays as wide as at the start, to lead back from afar."""
    sharp_from: float = 0.7
    """Share of the training after which the kernel narrows no more."""
    full_air: float = 0.1
    """Time in the air before the apex that earns the event's full weight, s."""
    full_period: float = 0.45
    """Time since the last apex that earns the event's full weight, s."""
    predicted: float = 0.3
    """Of the prediction in flight: |v| (e^(-e/15 mm) + e^(-e/60 mm) / 2)."""
    effective_gravity: float = 10.4
    """Deceleration in flight that the prediction assumes, rail drag included, m/s2."""
    energy: float = 0.4
    """Of v^2 anywhere, fading to zero until ``energy_until``."""
    energy_until: float = 0.35
    """Share of the training after which that gain is gone."""
    energy_beyond: float = 0.0
    """How far above the command the predicted apex is where the most of that gain has fallen to
    1/e, m; 0 pays it at any height. A leg that is paid for hopping too high for long learns a gait
    for it, stretched at every command, from which the narrow kernels do not lead back."""
    jerk: float = 0.15
    """Of the paper's Pj."""
    effort: float = 0.0
    """Of the actions' squares in flight, where they move nothing but the leg itself."""
    position: float = 0.02
    """Of the paper's Pjp."""
    velocity: float = 0.005
    """Of joint speed beyond ``velocity_limit``."""
    velocity_limit: float = 20.0
    """rad/s."""
    clearance: float = 1.0
    """Of coming closer to the ground than the two margins below, relative to them."""
    base_margin: float = 0.04
    """Wanted gap between base and ground, m."""
    knee_margin: float = 0.02
    """Wanted gap between knee and ground, m."""
    touch: float = 3.0
    """Of touching the ground with base or knee, or nearly so, per tick."""
    touch_margin: float = 0.006
    """Gap that counts as touching, m."""


class ApexReward:
    """Judges ticks by predicted and reached apexes.

    Args:
        robot: Whose joint limits and clearances count.
        options: Weights and widths.
        rate: Control rate, Hz.
    """

    def __init__(self, robot: Robot, options: ApexRewardOptions, rate: float) -> None:
        self.options, self._robot, self._rate = options, robot, rate
        self._lower, self._upper = robot.of_joints("lower"), robot.of_joints("upper")
        self._air = self._since = np.zeros(0)
        self.anneal(0.0)

    def anneal(self, share: float) -> None:
        """Narrow the kernel and fade the energy gain at a share of the training, 0 to 1."""
        wide, narrow = self.options.width
        self._width = wide + (narrow - wide) * min(1.0, share / self.options.sharp_from)
        self._energy = self.options.energy * max(0.0, 1 - share / self.options.energy_until)

    def state(self) -> dict[str, Any]:
        """Return every leg's time in the air and since its last apex."""
        return {"air": self._air.copy(), "since": self._since.copy()}

    def restore(self, state: dict[str, Any]) -> None:
        """Go on from a ``state``."""
        self._air, self._since = np.array(state["air"]), np.array(state["since"])

    names: tuple[str, ...] = (
        "apex",
        "predicted",
        "energy",
        "jerk",
        "effort",
        "position",
        "velocity",
        "clearance",
    )

    def __call__(self, transition: Transition) -> tuple[Array, Array]:
        """Return the reward, (n,), and its weighted parts before scaling, (n, 8)."""
        t, o = transition, self.options
        flying = t.foot_clearance >= FLIGHT_CLEARANCE
        if len(self._air) != len(flying):
            self._air, self._since = np.zeros(len(flying)), np.zeros(len(flying))
        self._air = np.where(flying, self._air + 1 / self._rate, 0.0)
        self._since = self._since + 1 / self._rate
        speed_squared = np.square(t.rate)
        over_speed = np.maximum(np.abs(t.qd) - o.velocity_limit, 0.0)
        terms = np.stack(
            [
                o.apex * self._event(t),
                np.where(flying, o.predicted * self._prediction(t, speed_squared), 0.0),
                self._energy * self._gain(t, speed_squared),
                -o.jerk * np.sum(np.square(t.action - t.last_action), axis=1),
                -o.effort * np.where(flying, np.sum(np.square(t.action), axis=1), 0.0),
                -o.position * self._position(t.q),
                -o.velocity * np.sum(over_speed, axis=1),
                -self._closeness(t),
            ],
            axis=1,
        )
        return o.scale * np.sum(terms, axis=1), terms

    def _event(self, t: Transition) -> Array:
        motion = np.square(np.minimum(1.0, self._air / self.options.full_air))
        patience = np.minimum(1.0, self._since / self.options.full_period)
        self._since = np.where(t.apex, 0.0, self._since)
        error = np.abs(t.apex_height - t.command)
        wide, tail = self.options.width[0], self.options.tail
        kernel = (1 - tail) * np.exp(-error / self._width) + tail * np.exp(-error / wide)
        return np.where(t.apex, motion * patience * kernel, 0.0)

    def _gain(self, t: Transition, speed_squared: Array) -> Array:
        most: float | Array = _FASTEST_SQUARED
        if self.options.energy_beyond > 0:
            above = np.maximum(self._predicted_apex(t, speed_squared) - t.command, 0.0)
            most = most * np.exp(-above / self.options.energy_beyond)
        gain: Array = np.minimum(speed_squared, most)
        return gain

    def _predicted_apex(self, t: Transition, speed_squared: Array) -> Array:
        apex: Array = t.height + speed_squared / (2 * self.options.effective_gravity)
        return apex

    def _prediction(self, t: Transition, speed_squared: Array) -> Array:
        error = np.abs(self._predicted_apex(t, speed_squared) - t.command)
        kernel = np.exp(-error / 0.015) + 0.5 * np.exp(-error / 0.06)
        return np.abs(t.rate) * kernel

    def _position(self, q: Array) -> Array:
        inside: BoolArray = (q >= self._lower) & (q <= self._upper)
        to_lower, to_upper = np.abs(q - self._lower), np.abs(q - self._upper)
        near = np.exp(-_SHARPNESS * to_lower) + np.exp(-_SHARPNESS * to_upper)
        penalty: Array = np.sum(np.where(inside, near, 1.0), axis=1)
        return penalty

    def _closeness(self, t: Transition) -> Array:
        """Return the weighted penalty of base and knee for coming close to the ground, (n,)."""
        o = self.options
        base = kinematics.base_clearance(self._robot, t.height)
        knee = kinematics.knee_clearance(self._robot, t.height, t.q)
        base_inside = np.maximum(o.base_margin - base, 0.0) / o.base_margin
        knee_inside = np.maximum(o.knee_margin - knee, 0.0) / o.knee_margin
        touching = np.minimum(base, knee) < o.touch_margin
        return o.clearance * (base_inside + knee_inside) + o.touch * touching
