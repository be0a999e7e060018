"""The paper's reward (Sec. II-C, "Reward"): R = w1 Ge - w2 Ph - w3 Pj - w4 Pjp - w5 Pjv.

A step's ``terms`` name Ge, Ph, Pj, Pjp and Pjv energy, height, jerk, position and velocity.
"""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.envs.transition import Transition
from hopping_leg.robot.parameters import Robot

Barrier = Literal["step", "printed"]


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
    """Ph above the desired height: e^(x - xd), or as printed 1 - e^(x - xd)."""
    rest_length: float = 0.2
    """Leg length of the initial standing position, m; x_o is the base height standing on it."""
    velocity_limit: float | None = None
    """Largest desired joint velocity, rad/s; none takes the motors' no-load speed at each joint."""


_SHARPNESS = 10.0
"""Of Pjp around the joint limits, 1/rad."""


class PaperReward:
    """Five terms, each on the true state after the tick.

    Between its limits Pjp is computed as 2 e^(-10 h) cosh(10 d) per joint, which is the printed sum
    of exponentials; d is the distance from their middle and h half their span.

    Args:
        robot: Whose joint limits count.
        options: Weights and readings.
    """

    def __init__(self, robot: Robot, options: PaperRewardOptions = PaperRewardOptions()) -> None:
        self.options = o = options
        lower, upper = robot.of_joints("lower"), robot.of_joints("upper")
        half = (upper - lower) / 2
        self._steepness = 2 * np.exp(-_SHARPNESS * half)
        self._surplus = self._steepness * np.cosh(_SHARPNESS * half) - 1
        limit = o.velocity_limit
        speed = robot.of_joints("no_load_speed") if limit is None else np.full(2, limit)
        rest = o.rest_length + robot.foot.radius
        self._weights = np.array([o.energy, -o.height, -o.jerk, -o.position, -o.velocity])
        self._origin_of_leg = np.array([rest, *(lower + upper) / 2, 0.0, 0.0, 0.0])
        self._bound_of_leg = np.array([np.inf, *half, np.inf, *speed])
        self._repeat(1)

    def _repeat(self, count: int) -> None:
        """Repeat constants for every leg: numpy combines equal shapes in half the time."""
        self._origin = np.tile(self._origin_of_leg, (count, 1))
        self._bound = np.tile(self._bound_of_leg, (count, 1))

    names: tuple[str, ...] = ("energy", "height", "jerk", "position", "velocity")

    def __call__(self, transition: Transition) -> tuple[Array, Array]:
        """Return the weighted sum, (n,), and the five unweighted terms, (n, 5)."""
        t, count = transition, len(transition.state)
        if len(self._origin) != count:
            self._repeat(count)
        terms = np.zeros((count, 5))
        energy, height, jerk, position, velocity = terms.T
        offset = t.state - self._origin
        square = offset * offset
        np.add(square[:, 3], square[:, 0], out=energy)
        crossed = t.height >= t.command
        if np.count_nonzero(crossed):
            np.multiply(self._barrier(t.height - t.command), crossed, out=height)
        change = t.action - t.last_action
        np.vecdot(change, change, out=jerk)
        size = np.abs(offset)
        outside = size > self._bound
        exceeds = np.count_nonzero(outside)
        within = np.minimum(size, self._bound) if exceeds else size
        np.vecdot(np.cosh(_SHARPNESS * within[:, 1:3]), self._steepness, out=position)
        if exceeds:
            position -= np.vecdot(outside[:, 1:3], self._surplus)
            over = square - within * within
            np.add(over[:, 4], over[:, 5], out=velocity)
        return np.vecdot(terms, self._weights), terms

    def state(self) -> dict[str, Any]:
        """Return nothing: every tick is judged by itself."""
        return {}

    def restore(self, state: dict[str, Any]) -> None:
        """Do nothing."""

    def _barrier(self, excess: Array) -> Array:
        """Return Ph of a base that is ``excess`` >= 0 above the desired height, m, (n,)."""
        growth = np.exp(excess)
        return 1 - growth if self.options.barrier == "printed" else growth
