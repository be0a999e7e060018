"""The paper's reward (Sec. II-C, "Reward"): R = w1 Ge - w2 Ph - w3 Pj - w4 Pjp - w5 Pjv."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.env.transition import Transition
from hopping_leg.robot.parameters import Robot

Barrier = Literal["step", "printed", "flipped"]

TERMS = ("energy", "height", "jerk", "position", "velocity")
"""Names of Ge, Ph, Pj, Pjp, Pjv in the step's ``terms``."""


@dataclass(frozen=True)
class PaperRewardOptions:
    """Weights as printed, and the readings of what the paper leaves open."""

    energy: float = 0.5
    """w1, of the energy gain Ge."""
    height: float = 2.0
    """w2, of the height barrier Ph."""
    jerk: float = 0.05
    """w3, of the jerky action penalty Pj."""
    position: float = 0.02
    """w4, of the joint position penalty Pjp."""
    velocity: float = 0.005
    """w5, of the joint velocity penalty Pjv."""
    barrier: Barrier = "step"
    """Ph above the desired height: e^(x - xd), or as printed 1 - e^(x - xd), or that flipped."""
    rest_length: float = 0.2
    """Leg length of the initial standing position, m; x_o is the base height standing on it."""
    velocity_limit: float | None = None
    """Largest desired joint velocity, rad/s; none takes the motors' no-load speed at each joint."""


class PaperReward:
    """Five terms, each on the true state after the tick.

    Args:
        robot: Whose joint limits count.
        options: Weights and readings.
    """

    def __init__(self, robot: Robot, options: PaperRewardOptions = PaperRewardOptions()) -> None:
        self.options = options
        self._rest = options.rest_length + robot.foot.radius
        self._lower, self._upper = robot.of_joints("lower"), robot.of_joints("upper")
        limit = options.velocity_limit
        speed = robot.of_joints("no_load_speed") if limit is None else np.full(2, limit)
        self._speed_squared = np.square(speed)
        o = options
        self._weights = np.array([o.energy, -o.height, -o.jerk, -o.position, -o.velocity])

    def __call__(self, transition: Transition) -> tuple[Array, dict[str, Array]]:
        """Return the weighted sum, (n,), and the five terms, each (n,)."""
        t = transition
        terms = np.empty((5, len(t.height)))
        terms[0] = np.square(t.rate) + np.square(t.height - self._rest)
        terms[1] = self._barrier(t.height - t.command)
        terms[2] = _sum(np.square(t.action - t.last_action))
        terms[3] = _sum(self._position(t.q))
        terms[4] = _sum(np.maximum(np.square(t.qd) - self._speed_squared, 0.0))
        return self._weights @ terms, dict(zip(TERMS, terms, strict=True))

    def _barrier(self, excess: Array) -> Array:
        crossed = excess >= 0
        growth = np.exp(excess)
        if self.options.barrier == "printed":
            growth = 1 - growth
        elif self.options.barrier == "flipped":
            growth = growth - 1
        return growth * crossed

    def _position(self, q: Array) -> Array:
        above, below = q - self._lower, q - self._upper
        inside = (above >= 0) & (below <= 0)
        near = np.exp(np.minimum(-10 * above, 0)) + np.exp(np.minimum(10 * below, 0))
        return np.where(inside, near, 1.0)


def _sum(of_joints: Array) -> Array:
    """Sum over hip and knee, (n, 2) to (n,)."""
    return of_joints[:, 0] + of_joints[:, 1]
